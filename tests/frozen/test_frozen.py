"""What the commands answer to the shipped data sets and to logs as other rigs record them, number by number, as kept.

shipped.json and rigs.json (its logs are made by rigs.py) hold chains of command lines, each with what it answered: the
leaves of the JSON that it writes (rows of a table as columns), a dozen samples of each replayed signal, every fiftieth
row of exported test vectors. A line reads what those before it in its chain wrote. A new one is added with {} behind.

`python tests/frozen/test_frozen.py` runs all chains and writes their numbers anew (`… shipped`, `… rigs`: those of one
file); the commit says which numbers moved, and why. `… loosen`, on another processor (or OPENBLAS_CORETYPE=Nehalem
and NPY_DISABLE_CPU_FEATURES set), leaves the numbers and moves those that differ there to a section that allows it.
"""

import json
import math
import os
import re
import runpy
import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import chdir, redirect_stdout
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

for _name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import h5py  # noqa: E402
import pytest  # noqa: E402

from eaid.cli import main  # noqa: E402

HERE = Path(__file__).parent
DATASETS = HERE.parents[1] / "datasets"
Leaves = dict[str, list[Any]]

SECTIONS = {"numbers": 1e-9, "intervals": 1e-6, "rounding": 1e-6, "searches": 1e-3, "unsteady": math.inf}
"""Relative difference that each section of kept numbers allows. `rounding`: ill-conditioned ones, which another order
of additions moves; `searches`: where a search ends is not quite the same on every processor; `unsteady`: nowhere."""
SECTION_OF = {
    "searches": re.compile(r"adequacy\.shapes"),
    "intervals": re.compile(r"ci95|half_width|uncertainty|degrees"),
}

LEFT_OUT = re.compile(
    r"(^|\.)(schema|eaid|digest|parameters|responses|dof|options|command|seed|inputs|path|sha256|synthetic|source|means|method|message|text"
    r"|warnings|starts|evaluations|predicted_decrease|solver|conventions|convention|other_weights|weights|level_weights"
    r"|agreement|periodic|ripple\w*|matrix|order|parametrisation|regions|R2|severity|subject|values|unit|apparatus|rig"
    r"|\w+_unit|C_free|nominal|readings|q[13]|whisker_\w+|outliers|n|never|anti_windup|timing|curves\.frequency_hz"
    r"|per_level\.(abs_error|level|fit_pct)|curves\.level|levels\.(fit_pct|from|start|delay_s|speed_rpm)|steps\.findings"
    r"|steps\.run|joint\.(curves|ci95|covariance|estimator)|logs\.curve|worst\.(tau\d|Ts|plant)|scatter_from"
    r"|sources\.(run|edge|samples|level|repeat)|shapes\.name|test|where|time_s|(pi|open-loop|inverse)\.reference_nm"
    r"|chi_nm_s|rho_nm_s|counted_from_s|evidence|(per_level|levels)\.(converged|rmse|C|shape|c0|samples)"
    r"|margins\.points\.(\w+\.stable|duty_pct|torque_nm)|steps\.(fit_pct|samples|rmse)|record_s|draws|per_0.01_pct)(\.|$)"
)
"""Keys that are no answer, repeat another, or are about to go: readings of B, weights beside equal ones, ripple."""
BRIEF = re.compile(
    r"(exit code|converged|findings|(friction\.levels|nonlinear|linear|linear\.(per_level|bounds)|release)"
    r"\.(Ts|tau[12]|C|[abc]0|B|B_[mM]|rmse|sse|estimator)"
    r"|(rc|pi|rc\.rho|guarantee|margins\.worst\.(rc|pi)|walls)\.\w+"
    r"|controllers\.[\w-]+\.(\w+|frequencies\.\w+|plants\.metrics\.rms_error_nm\..+)|[\w-]+\.(duty_pct|torque_nm)"
    r"|recorded\.falls\.\w+|steps\.\w+)"
)
"""What is kept of a result like another, but for some choices: files named brief, and of those named again nothing."""


def leaves(value: Any, path: str, into: Leaves) -> Leaves:
    """Numbers and words of a plain result by path; those of a list stand in one list, rows of a table as columns."""
    if path == "findings":
        into[path] = sorted(" ".join([row["code"], *(f"{level:g}" for level in row["levels"])]) for row in value)
    elif isinstance(value, dict):
        for key, part in value.items():
            leaves(part, f"{path}.{'*' if path == 'log' else key}" if path else key, into)
    elif isinstance(value, list):
        for part in value:
            leaves(part, path, into)
    else:
        into.setdefault(path, []).append(value)
    return into


def signals(file: Path) -> Leaves:
    """Every signal of a replay.h5 or data.h5."""
    into: Leaves = {}

    def take(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.ndim == 1 and item.dtype.kind == "f":
            into[name.replace("/", ".")] = [x if math.isfinite(x) else None for x in item[:].tolist()]

    with h5py.File(file) as held:
        held.visititems(take)
    return into


def vectors(file: Path) -> Leaves:
    """Every fiftieth row of exported test vectors, as columns, and how many rows there are."""
    head, *rows = [line.split(",") for line in file.read_text(encoding="utf-8").splitlines() if line]
    columns = zip(head, *rows[::50], strict=True)
    numbers = re.compile(r"[-+.\de]+")
    into = {name: [float(x) if numbers.fullmatch(x) else x for x in column] for name, *column in columns}
    return {"rows": [len(rows)], **into}


def thinned(columns: Leaves) -> Leaves:
    """Twelve digits; of a column that is constant how long it is, of one beyond twenty also a dozen of its values."""
    into: Leaves = {}
    for path, column in columns.items():
        count = len(column)
        some = column if count <= 20 else [count, *(column[k * (count - 1) // 11] for k in range(12))]
        if count > 2 and all(value == column[0] for value in column):
            some = [f"{count} × {column[0]}"]
        into[path] = [float(f"{x:.12g}") if isinstance(x, float) else x for x in some]
    return into | ({"findings": columns["findings"]} if "findings" in columns else {})


def answer(line: str, folder: Path, printed: Callable[[], str], **places: Path) -> Leaves:
    """What one command line of a chain answers: its exit code, its JSON, samples of the file that it writes."""
    words = [word.format(**places) for word in shlex.split(line)]
    out = folder / words[words.index("-o") + 1] if "-o" in words else folder
    with chdir(folder):
        printed()
        code = main.run([*words, "--json", "-q"])
    into: Leaves = {"exit code": [code]}
    text = printed()
    if code not in (0, 4) or out.name.startswith("again"):
        return into
    if words[0] == "export":
        into |= vectors(out / "vectors.csv")
    else:
        leaves(json.loads(out.read_text(encoding="utf-8") if out.suffix == ".json" else text), "", into)
    if out.suffix == ".h5" and "--log" not in words:
        into |= signals(out)
    brief = BRIEF if "brief" in out.name else re.compile(".*")
    wanted = (path for path in into if brief.fullmatch(path) and not LEFT_OUT.search(path))
    return thinned({path: into[path] for path in wanted if not {None}.issuperset(into[path])})


def apart(old: list[Any], new: list[Any]) -> list[float]:
    """Relative differences, of a number next to zero from a tenth of its column's largest; inf for other words."""
    if len(old) != len(new):
        return [math.inf]
    largest = max((abs(x) for x in old if isinstance(x, float | int)), default=0.0)
    return [
        abs(a - b) / max(abs(a), 0.1 * largest, 1e-12)
        if isinstance(a, float | int) and isinstance(b, float | int)
        else 0.0
        if a == b
        else math.inf
        for a, b in zip(old, new, strict=True)
    ]


def differences(now: Leaves, kept: dict[str, Leaves]) -> Iterator[str]:
    """Rows path, kept, now, relative difference; of columns of other lengths what only one of them holds."""
    unknown: Leaves = {path: [] for path in now if not any(path in part for part in kept.values())}
    for section, part in {**kept, "new": unknown}.items():
        for path, old in part.items():
            new = now.get(path, [])
            pairs = (
                list(zip(old, new, strict=True))
                if len(old) == len(new)
                else [([x for x in old if x not in new], [x for x in new if x not in old])]
            )
            for k, away in enumerate(apart(old, new)):
                if away > SECTIONS.get(section, 0.0):
                    a, b = pairs[k]
                    yield f"{f'{path}[{k}]':55} {a!s:>20} {b!s:>20} {away:9.1e}"


def kept_of(group: str) -> dict[str, dict[str, dict[str, Leaves]]]:
    """Name of a chain → command line → section → numbers by path."""
    kept: dict[str, dict[str, dict[str, Leaves]]] = json.loads((HERE / f"{group}.json").read_text(encoding="utf-8"))
    return kept


def chains(group: str) -> list[Any]:
    return [pytest.param(name, marks=pytest.mark.slow if name.endswith("(slow)") else ()) for name in kept_of(group)]


def check(group: str, name: str, folder: Path, capsys: pytest.CaptureFixture[str], **places: Path) -> None:
    """Run a chain; all its differences from what was kept, in one message."""
    told = []
    for line, sections in kept_of(group)[name].items():
        now = answer(line, folder, lambda: capsys.readouterr().out, **places)
        rows = list(differences(now, sections))
        told += [f"\neaid {line}", *rows] if rows else []
    if told:
        pytest.fail("\n".join([f"{'path':55} {'kept':>20} {'now':>20} {'relative':>9}", *told]), pytrace=False)


@pytest.mark.parametrize("name", chains("shipped"))
def test_shipped(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    check("shipped", name, tmp_path, capsys, data=DATASETS)


@pytest.mark.parametrize("name", chains("rigs"))
def test_rigs(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], rigs: Path) -> None:
    check("rigs", name, tmp_path, capsys, logs=rigs)


def sorted_in(now: Leaves, kept: dict[str, Leaves]) -> dict[str, Leaves]:
    """An answer, each path in the section where it was kept, a new one where its name belongs; as kept where alike."""
    sections: dict[str, Leaves] = {name: {} for name in SECTIONS}
    for path, column in now.items():
        by_name = (name for name, paths in SECTION_OF.items() if paths.search(path))
        section = next((name for name, part in kept.items() if path in part), next(by_name, "numbers"))
        old = kept.get(section, {}).get(path, [])
        sections[section][path] = old if max(apart(old, column)) <= SECTIONS[section] else column
    return {name: part for name, part in sections.items() if part}


def loosened(now: Leaves, kept: dict[str, Leaves]) -> dict[str, Leaves]:
    """What was kept, but each path that this machine answers differently in a section that allows ten times that."""
    sections: dict[str, Leaves] = {name: {} for name in SECTIONS}
    for section, part in kept.items():
        for path, column in part.items():
            away = 10 * max(apart(column, now.get(path, [])))
            fits = away <= SECTIONS[section]
            to = section if fits else next(name for name in ("rounding", *SECTIONS) if away <= SECTIONS[name])
            sections[to][path] = column if to != "unsteady" else []
    return {name: part for name, part in sections.items() if part}


def keep(group: str, how: Callable[[Leaves, dict[str, Leaves]], dict[str, Leaves]]) -> None:
    """Run the commands of a group and write their answers."""
    kept = kept_of(group)
    for chain in kept.values():
        with TemporaryDirectory() as folder, TemporaryDirectory() as logs, redirect_stdout(StringIO()) as held:

            def printed(held: StringIO = held) -> str:
                text = held.getvalue()
                held.seek(0), held.truncate()
                return text

            runpy.run_path(str(HERE / "rigs.py"))["write"](Path(logs))
            for line, sections in chain.items():
                chain[line] = how(answer(line, Path(folder), printed, data=DATASETS, logs=Path(logs)), sections)
    (HERE / f"{group}.json").write_text(written(kept) + "\n", encoding="utf-8")


def written(value: Any) -> str:
    """JSON, one key a line."""
    if isinstance(value, dict) and value:
        rows = (f"{json.dumps(key, ensure_ascii=False)}: {written(part)}" for key, part in value.items())
        return "{\n" + ",\n".join(rows) + "\n}"
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"))


if __name__ == "__main__":
    if set(sys.argv[1:]) - {"shipped", "rigs", "loosen"}:
        sys.exit(__doc__)
    for _group in {"shipped", "rigs"}.intersection(sys.argv) or ("shipped", "rigs"):
        keep(_group, loosened if "loosen" in sys.argv else sorted_in)
