"""What the commands answer to the shipped data sets and to recorded logs of other rigs, number by number, as kept.

A row is a command line; its kept numbers are the leaves of the JSON that it writes (rows of a table as columns), a
dozen samples of each replayed signal, every fiftieth row of exported test vectors. `python tests/frozen/test_frozen.py
shipped` (or `realdata`) runs the commands and writes the numbers anew; the commit says which moved, and why.
"""

import json
import math
import os
import re
import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import chdir
from pathlib import Path
from typing import Any

for _name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import h5py  # noqa: E402
import pytest  # noqa: E402

from eaid.cli import main  # noqa: E402

HERE = Path(__file__).parent
Leaves = dict[str, list[Any]]

CHAINS = {
    "shipped": {
        "clutch": """
            fit {data}/clutch.h5 -o fit.json
            fit {data}/clutch.h5 --estimator joint -o brief.json
            tune-rc fit.json -o gains.json
            tune-rc fit.json --bounds-levels 30:100 --kp 4.5 --kd 3 --q-max 5 --phi 0.05 --pi-gains 21,360
                -o brief-paper.json
            tune-rc fit.json --b-hat minimax --rho textbook --phi data --reference multisine -o brief-gains.json
            simulate fit.json --gains gains.json --scenario steps -o steps.h5
            simulate fit.json --gains gains.json --scenario multisine -o multisine.h5
            simulate fit.json --gains gains.json --controller rc --scenario rehab --duration 20
                -o rehab.h5
            simulate fit.json --gains brief-paper.json --scenario ramp --controller rc,pi,feedforward,inverse,open-loop
                --noise-nm 0.01 --pwm-hz 300 --delay-samples 2 --duty-bits 8 --sensor-hz 50 -o brief-ramp.h5
            synth --levels 30,70 --repeats 1 --rate-hz 100 --seed 3 -o log.h5
            simulate fit.json --log log.h5 -o log-replay.h5
            export gains.json -o c
            export gains.json --as arduino --precision single -o arduino
            couple fit.json --gains gains.json --torque 1.8 --loops rc,pi -o couple.json
            plan fit.json --no-check -o plan.csv
        """,
        "friction": """
            fit {data}/friction-force.h5 -o force.json
            fit {data}/friction-speed.h5 -o speed.json
        """,
        "slow": """
            fit {data}/clutch.h5 -o brief-fit.json
            fit {data}/clutch.h5 --loss huber -o brief-huber.json
            fit {data}/clutch.h5 --ci none -o brief-none.json
            fit {data}/clutch.h5 --share free --hold-out 40,70 --ci none -o brief-share.json
            tune-rc brief-fit.json -o brief-gains.json
            simulate brief-fit.json --gains brief-gains.json --scenario sweep -o brief-sweep.h5
            simulate brief-fit.json --gains brief-gains.json --plants 8 --seed 2 -o brief-plants.h5
            simulate brief-fit.json --log {data}/clutch.h5 -o log-replay.h5
            couple brief-fit.json --gains brief-gains.json -o couple.json
            synth --excitation random --rate-hz 50 -o random
            fit random -o recorded.json
        """,
    },
}
"""Command lines of a chain; each reads what those before it wrote. A line that is indented further belongs to the one
before it."""

SLOW = {"slow"}
"""Chains that `make test` leaves out."""

SECTIONS = {
    "searches": (re.compile(r"adequacy|steps\.(shape|aicc|C|tau2)"), 1e-3),
    "intervals": (re.compile(r"ci95|parameters|degrees_of_freedom|half_width|uncertainty|covariance|widths"), 1e-6),
    "numbers": (re.compile(""), 1e-9),
}
"""Section → paths that belong to it (the first that fits), relative difference that is allowed. Which shape of several
a search prefers is told by differences of rounding on some processors: `searches`."""

LEFT_OUT = re.compile(
    r"(^|\.)(schema|eaid|digest|options|command|seed|inputs|path|sha256|synthetic|source|means|method|message|text"
    r"|warnings|starts|evaluations|predicted_decrease|conventions|convention|other_weights|weights|level_weights"
    r"|agreement|periodic|ripple\w*|matrix|order|parametrisation|regions|R2|severity|subject|values|unit|apparatus|rig"
    r"|\w+_unit|C_free|nominal|readings|q[13]|whisker_\w+|outliers|n|never|anti_windup|timing|curves\.frequency_hz"
    r"|per_level\.abs_error|joint\.(curves|per_level\.fit_pct|ci95|covariance)|at_estimate\.ci95|worst\.(tau\d|Ts|plant)"
    r"|sources\.(run|edge|samples|level|repeat)|shapes\.name|test|where|time_s|(pi|open-loop|feedforward|inverse)\.reference_nm)(\.|$)"
)
"""Keys that are no answer, repeat another, or are about to go: readings of B, weights beside equal ones, ripple."""
BRIEF = re.compile(
    r"(exit code|converged|(friction\.levels|nonlinear|linear|linear\.(per_level|bounds)|release|findings)"
    r"\.(Ts|tau[12]|C|[abc]0|B|B_[mM]|rmse|sse|code|identifiable|estimator)"
    r"|(rc|pi|rc\.rho|rc\.ultimate_bound|guarantee|margins\.worst\.(rc|pi)|walls)\.\w+"
    r"|controllers\.[\w-]+\.(\w+|frequencies\.\w+|plants\.metrics\.rms_error_nm\..+)|[\w-]+\.(duty_pct|torque_nm)"
    r"|recorded\.(asked|falls)\.\w+|steps\.\w+)"
)
"""What is kept of a result that repeats another under other choices: files named brief."""


def lines_of(chain: str) -> Iterator[str]:
    """Command lines of a chain, each in one line."""
    yield from map(str.strip, re.sub(r"\n {16}", " ", chain).strip().splitlines())


def leaves(value: Any, path: str, into: Leaves) -> Leaves:
    """Numbers and words of a plain result by path; those of a list stand in one list, rows of a table as columns."""
    if isinstance(value, dict):
        for key, part in value.items():
            leaves(part, f"{path}.{'*' if path == 'log' else key}" if path else key, into)
    elif isinstance(value, list):
        for part in value:
            leaves(part, path, into)
    elif not LEFT_OUT.search(path):
        into.setdefault(path, []).append(float(f"{value:.12g}") if isinstance(value, float) else value)
    return into


def thinned(columns: Leaves) -> Leaves:
    """Without columns of nothing; of a constant one how long it is, of one beyond twenty also a dozen values."""
    into: Leaves = {}
    for path, column in columns.items():
        count = len(column)
        if count > 2 and all(value == column[0] for value in column):
            into[path] = [f"{count} × {column[0]}"]
        else:
            into[path] = column if count <= 20 else [count, *(column[k * (count - 1) // 11] for k in range(12))]
    return {path: column for path, column in into.items() if any(value is not None for value in columns[path])}


def samples(file: Path) -> Leaves:
    """Every signal of a replay.h5 or data.h5."""
    into: Leaves = {}

    def take(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.ndim == 1 and item.dtype.kind == "f":
            leaves(item[:].tolist(), name.replace("/", "."), into)

    with h5py.File(file) as held:
        held.visititems(take)
    return into


def vectors(file: Path) -> Leaves:
    """Every fiftieth row of exported test vectors, as columns, and how many rows there are."""
    head, *rows = [line.split(",") for line in file.read_text(encoding="utf-8").splitlines() if line]
    into: Leaves = {"rows": [len(rows)]}
    for name, *column in zip(head, *rows[::50], strict=True):
        into[name] = [float(f"{float(x):.12g}") if re.fullmatch(r"[-+.\de]+", x) else x for x in column]
    return into


def answer(line: str, folder: Path, printed: Callable[[], str], **places: Path) -> Leaves:
    """What one command line of a chain answers: its exit code, its JSON, samples of the file that it writes."""
    words = [word.format(**places) for word in shlex.split(line)]
    out = folder / words[words.index("-o") + 1] if "-o" in words else folder
    with chdir(folder):
        printed()
        code = main.run([*words, "--json", "-q"])
    into: Leaves = {"exit code": [code]}
    text = printed()
    if code in (0, 4) and words[0] != "export":
        leaves(json.loads(out.read_text(encoding="utf-8") if out.suffix == ".json" else text), "", into)
    if out.suffix == ".h5" and "--log" not in words:
        into |= samples(out)
    if words[0] == "export":
        into |= vectors(out / "vectors.csv")
    if "brief" in out.name:
        into = {path: column for path, column in into.items() if BRIEF.fullmatch(path)}
    return thinned(into)


def section_of(path: str) -> str:
    return next(name for name, (paths, _) in SECTIONS.items() if paths.search(path))


def differences(now: Leaves, kept: Leaves) -> Iterator[str]:
    """Rows path, kept, now, relative difference; a number next to zero is held to a tenth of its list's largest."""
    for path in sorted(now.keys() | kept.keys()):
        old, new = kept.get(path), now.get(path)
        if old is None or new is None or len(old) != len(new):
            yield f"{path:55} {short(old)} → {short(new)}"
            continue
        largest = max((abs(x) for x in old if isinstance(x, float | int)), default=0.0)
        for k, (a, b) in enumerate(zip(old, new, strict=True)):
            if isinstance(a, float | int) and isinstance(b, float | int):
                away = abs(a - b) / max(abs(a), 0.1 * largest, 1e-12)
                alike = away <= SECTIONS[section_of(path)][1]
            else:
                away, alike = math.nan, a == b
            if not alike:
                yield f"{f'{path}[{k}]':55} {a!s:>20} {b!s:>20} {away:9.1e}"


def short(column: list[Any] | None) -> str:
    return "nothing" if column is None else f"{len(column)} values {str(column)[:50]}"


def run_chain(name: str, group: str, folder: Path, printed: Callable[[], str], **places: Path) -> dict[str, Leaves]:
    return {line: answer(line, folder, printed, **places) for line in lines_of(CHAINS[group][name])}


def compare(group: str, name: str, answers: dict[str, Leaves]) -> None:
    """All differences of a chain's answers from those kept, in one message."""
    kept = json.loads((HERE / f"{group}.json").read_text(encoding="utf-8"))[name]
    told = []
    for line, now in answers.items():
        old = {path: column for part in kept.get(line, {}).values() for path, column in part.items()}
        told += [f"\neaid {line}", *rows] if (rows := list(differences(now, old))) else []
    if told:
        pytest.fail("\n".join([f"{'path':55} {'kept':>20} {'now':>20} {'relative':>9}", *told]), pytrace=False)


def chains(group: str) -> list[Any]:
    return [pytest.param(name, marks=pytest.mark.slow if name in SLOW else ()) for name in CHAINS[group]]


@pytest.mark.parametrize("name", chains("shipped"))
def test_shipped(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = HERE.parents[1] / "datasets"
    compare("shipped", name, run_chain(name, "shipped", tmp_path, lambda: capsys.readouterr().out, data=data))


def keep(group: str, **places: Path) -> None:
    """Run the commands of a group and write their answers."""
    import io
    import tempfile
    from contextlib import redirect_stdout

    kept: dict[str, Any] = {}
    for name in CHAINS[group]:
        with tempfile.TemporaryDirectory() as folder, redirect_stdout(io.StringIO()) as held:

            def printed(held: io.StringIO = held) -> str:
                text = held.getvalue()
                held.seek(0), held.truncate()
                return text

            answers = run_chain(name, group, Path(folder), printed, **places)
        kept[name] = {
            line: {
                section: {path: compact(column) for path, column in now.items() if section_of(path) == section}
                for section in SECTIONS
            }
            for line, now in answers.items()
        }
    text = json.dumps(kept, ensure_ascii=False, indent=0).replace('"[', "[").replace(']"', "]").replace('\\"', '"')
    (HERE / f"{group}.json").write_text(text + "\n", encoding="utf-8")


def compact(column: list[Any]) -> str:
    return json.dumps(column, ensure_ascii=False, separators=(",", ":"))


if __name__ == "__main__":
    data = HERE.parents[1] / "datasets"
    for group in sys.argv[1:]:
        keep(group, data=data)
