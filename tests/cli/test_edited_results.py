"""Results of which one value is deleted or replaced at random: every command that reads one ends well, or says why not.
`EAID_EDITS=500` makes so many edits, in place of a few."""

import copy
import json
import os
import random
from collections import defaultdict
from pathlib import Path

import pytest

EDITS = int(os.environ.get("EAID_EDITS", "24"))
QUICK = 2
VALUES = [None, "x", "", "1.5", [], {}, [1, 2], [None, None], [[1]], ["x"], {"a": 1}, True, 3, 0, -1.0, -1e6, 1e30,
          1e308, -1e308, 1e-300]  # fmt: skip
DELETED = object()
STEPS = "simulate fit.json --gains gains.json --scenario steps --duration 2 -o replay.h5"
READERS = {
    "fit.json": ["report fit.json --figures fig08 -o page", "tune-rc fit.json -o g.json", STEPS,
                 "tune-rc fit.json --phi data -o g.json", "plan fit.json --no-check -o plan.csv",
                 "simulate fit.json --controller inverse --plants 2 --duration 2 -o replay.h5",
                 "synth --plant fit.json --levels 50 --repeats 1 --rate-hz 50 -o synth.h5"],
    "force.json": ["report force.json --figures fig04 -o page", "plan force.json --no-check -o plan.csv",
                   "synth --plant force.json --repeats 1 --rate-hz 20 --hold 5 -o synth.h5"],
    "gains.json": ["report gains.json -o page", STEPS, "export gains.json --anyway -o code"],
}  # fmt: skip


def places(value, at=()):
    """Paths of all values inside, those that differ by the number in a list under one key."""
    found = defaultdict(list)
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        path = (*at, key)
        found[tuple("#" if isinstance(k, int) else k for k in path)].append(path)
        for alike, inner in places(item, path).items():
            found[alike] += inner
    return found


def edited(content, chance):
    """A copy with one value changed, and what was done."""
    content = copy.deepcopy(content)
    alike = places(content)
    path = chance.choice(alike[chance.choice(sorted(alike, key=str))])
    value = chance.choice([DELETED, DELETED, *VALUES])
    inside = content
    for key in path[:-1]:
        inside = inside[key]
    if value is DELETED:
        del inside[path[-1]]
    else:
        inside[path[-1]] = value
    return content, f"{'.'.join(map(str, path))} = {'deleted' if value is DELETED else json.dumps(value)}"


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize(
    "number", [pytest.param(k, marks=[pytest.mark.slow] if k >= QUICK else []) for k in range(EDITS)]
)
def test_an_edited_result_is_used_or_refused(rig, number, run_eaid):
    chance = random.Random(number)
    name = chance.choice(["fit.json", "fit.json", "force.json", "gains.json"])
    content = json.loads(Path(name).read_text(encoding="utf-8"))
    del content["digest"]
    content, what = edited(content, chance)
    Path(name).write_text(json.dumps(content))
    for line in READERS[name] if EDITS > 100 else chance.sample(READERS[name], 2):
        ran = run_eaid(line, "--force")
        assert ran.code in {0, 2, 3, 4, 5}, (what, line, ran.err)
        assert "Traceback" not in ran.err and "RuntimeWarning" not in ran.err, (what, line, ran.err)
        assert (ran.code == 0) or "error: " in ran.err, (what, line, ran.err)
