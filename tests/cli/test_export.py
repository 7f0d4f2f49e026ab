"""`eaid export`: which laws of which files, into which folder."""

import hashlib
import json
from pathlib import Path

import pytest


@pytest.fixture(autouse=True)
def _here(by_hand):
    """Every test begins beside the published gains and the paper's plant."""


def edited(**changes):
    content = json.loads(Path("gains.json").read_text())
    Path("gains.json").write_text(json.dumps({**content, **changes}))


def test_which_laws_stand_in_the_folder(run_eaid):
    ran = run_eaid("export gains.json")
    assert (ran.code, ran.out) == (0, "") and Path("export/eaid_control.c").is_file()
    assert "export: pi, rc as c, 7 files; next: read export/README.md" in ran.err
    assert "warning: RC: these gains do not say whether the guarantee holds" in ran.err
    assert "rig: inverse, plant as yaml, 3 files" in run_eaid("export fit.json --as yaml -o rig").err
    ran = run_eaid("export fit.json gains.json --as yaml --json -q -o both")
    told = json.loads(ran.out)
    assert told["laws"] == ["pi", "rc", "inverse", "plant"] and told["dt_s"] == 0.001
    assert told["files"] == ["parameters.yaml", "vectors.csv", "README.md"] == [*told["files"]]
    assert {file.name for file in Path("both").iterdir()} == set(told["files"])
    assert [one["code"] for one in told["findings"]] == ["export-guarantee-unknown", "export-no-release"]
    head = Path("both/parameters.yaml").read_text()
    assert "# from gains.json, sha256 " in head and "# from fit.json, sha256 " in head


def test_the_fit_that_gains_name_is_taken_where_it_lies_beside_them(run_eaid):
    digest = hashlib.sha256(Path("fit.json").read_bytes()).hexdigest()
    edited(inputs={"fit": {"path": "somewhere/else/fit.json", "sha256": digest}})
    ran = run_eaid("export gains.json --law rc,plant -o rig")
    assert ran.code == 0 and "with fit.json, which the gains were made from" in ran.err
    Path("fit.json").write_text(Path("fit.json").read_text() + " ")  # another one by now
    ran = run_eaid("export gains.json --law rc,plant -o other")
    assert ran.code == 2 and "--law plant needs what was not given: fit.json" in ran.err


def test_the_command_stands_at_the_head(run_eaid, monkeypatch):
    words = ["export", "gains.json", "--law", "pi", "-o", "rig with space"]
    monkeypatch.setattr("sys.argv", ["eaid", *words])
    assert run_eaid(words).code == 0
    text = Path("rig with space/eaid_control.c").read_text()
    assert "by eaid export gains.json --law pi -o 'rig with space'" in text
