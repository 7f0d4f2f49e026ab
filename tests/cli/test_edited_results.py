"""Results edited at random: every command that reads one ends well, or with a sentence and a documented code.

One value of fit.json or gains.json is deleted or replaced by what does not belong there. `EAID_EDITS=500` makes so many
edits, in place of the few of CI.
"""

import copy
import json
import os
import random
from collections import defaultdict
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest

from eaid.cli.main import run

EDITS = int(os.environ.get("EAID_EDITS", "16"))
DOCUMENTED = {0, 2, 3, 4, 5}
VALUES: list[Any] = [
    None, "x", "", "1.5", [], {}, [1, 2], [None, None], [[1]], ["x"], {"a": 1}, True, 3, 0, -1.0, -1e6, 1e6, 1e30,
    1e308, -1e308, 1e-300,
]  # fmt: skip
DELETED = object()
READERS: dict[str, list[str]] = {
    "fit.json": [
        "report {fit.json} -o {out}/page",
        "tune-rc {fit.json} -o {out}/gains.json",
        "tune-rc {fit.json} --widen-bounds --bounds-levels 30:100 -o {out}/gains.json",
        "simulate {fit.json} --gains {gains.json} --scenario steps --duration 2 -o {out}/replay.h5",
        "simulate {fit.json} --controller inverse --plants 2 --noise residuals --duration 2 -o {out}/replay.h5",
        "plan {fit.json} --no-check -o {out}/plan.csv",
        "synth --plant {fit.json} --levels 50 --repeats 1 --rate-hz 50 -o {out}/synth.h5",
    ],
    "force.json": [
        "report {force.json} -o {out}/page",
        "plan {force.json} --no-check -o {out}/plan.csv",
        "synth --plant {force.json} --repeats 1 --rate-hz 20 --hold 5 -o {out}/synth.h5",
    ],
    "gains.json": [
        "report {gains.json} -o {out}/page",
        "simulate {fit.json} --gains {gains.json} --scenario steps --duration 2 -o {out}/replay.h5",
    ],
}


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("edited")
    small = ["--rate-hz", "50", "--repeats", "2", "-q"]
    for arguments in (
        ["synth", *small, "--levels", "20:100:20", "-o", f"{folder}/clutch.h5"],
        ["synth", *small, "--kind", "friction-force", "-o", f"{folder}/force.h5"],
        ["fit", f"{folder}/clutch.h5", "-q", "-o", f"{folder}/fit.json"],
        ["fit", f"{folder}/force.h5", "-q", "-o", f"{folder}/force.json"],
        ["tune-rc", f"{folder}/fit.json", "-q", "-o", f"{folder}/gains.json"],
    ):
        assert run(arguments) == 0, arguments
    return folder


def places(value: Any, at: tuple[Any, ...] = ()) -> dict[tuple[Any, ...], list[tuple[Any, ...]]]:
    """Paths of all values inside, those that differ by the number in a list under one key."""
    found: defaultdict[tuple[Any, ...], list[tuple[Any, ...]]] = defaultdict(list)
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        path = (*at, key)
        found[tuple("#" if isinstance(k, int) else k for k in path)].append(path)
        for alike, inner in places(item, path).items():
            found[alike] += inner
    return found


def edited(content: dict[str, Any], chance: random.Random) -> tuple[dict[str, Any], str]:
    """A copy with one value changed, and what was done."""
    content = copy.deepcopy(content)
    alike = places(content)
    path = chance.choice(alike[chance.choice(sorted(alike, key=str))])
    value = chance.choice([DELETED, DELETED, *VALUES])
    inside: Any = content
    for key in path[:-1]:
        inside = inside[key]
    if value is DELETED:
        del inside[path[-1]]
    else:
        inside[path[-1]] = value
    return content, f"{'.'.join(map(str, path))} = {'deleted' if value is DELETED else json.dumps(value)}"


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("number", range(EDITS))
def test_an_edited_result_is_used_or_refused(
    results: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    monkeypatch.setitem(mpl.rcParams, "savefig.dpi", 30)
    chance = random.Random(number)
    name = chance.choice(["fit.json", "fit.json", "force.json", "gains.json"])
    content = json.loads((results / name).read_text())
    del content["digest"]
    content, what = edited(content, chance)
    (tmp_path / name).write_text(json.dumps(content))
    readers = READERS[name] if EDITS > 100 else chance.sample(READERS[name], 2)
    for line in readers:
        files = {file: str((tmp_path if file == name else results) / file) for file in READERS}
        arguments = [word.replace("{out}", str(tmp_path)) if "{out}" in word else word for word in line.split()]
        arguments = [files.get(word.strip("{}"), word) if word.startswith("{") else word for word in arguments]
        code = run([*arguments, "--force"])
        said = capfd.readouterr().err
        assert code in DOCUMENTED, (what, line, said)
        assert "Traceback" not in said and "RuntimeWarning" not in said, (what, line, said)
        if code:
            assert "error: " in said, (what, line, said)
