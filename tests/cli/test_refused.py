"""Calls that cannot mean anything end with exit 2 and one sentence, at once, and leave nothing."""

import shlex
from pathlib import Path

import pytest

from eaid.cli import main

LINES = r"""
fit data.h5 --seed -1 --ci bootstrap
fit data.h5 --seed 12345678901234567890123456
fit data.h5 --model ,
fit data.h5 --share nan
fit data.h5 --dead-time 1e300
fit data.h5 --rest nan
fit data.h5 --rest 1e400
fit data.h5 --duty 10:100
fit data.h5 --instrument
fit data.h5 --apparatus surface=2
fit data.h5 --columns "a=b\nc"
fit data.h5 --rate-hz 100
ingest data.h5 -o data.h5 --force
fit data.h5 -o data.h5 --force
fit data.h5 -o /dev/null --force
tune-rc fit.json -o fit.json --force
tune-rc fit.json --data data.h5
simulate fit.json --log data.h5 --rate-hz 100
simulate fit.json --log data.h5 --noise-nm 0.1
simulate fit.json --columns time=T
simulate fit.json --gains fit.json -o fit.json --force
plan fit.json --limits rest=5
plan fit.json --excitation --most-levels 5
plan fit.json --excitation --limits engagements=nan
plan fit.json --excitation --limits rest=1e300
plan fit.json --excitation --limits dutty=10:100
plan fit.json -o fit.json --force
synth --rate-hz 1e5
synth --hold nan
synth --controller rc
synth --excitation random --repeats 10000 -o logs
synth --excitation random --shape levels=nan -o logs
synth --excitation random --shape levels=1000000 -o logs
synth --excitation multisine --shape tones=1e300 -o logs
synth --excitation multisine --shape periods=0 -o logs
synth --excitation chirp --shape idle_s=nan -o logs
synth --excitation closed-loop --shape reference_nm=nan:3 -o logs
synth --excitation closed-loop --shape gains=nan:3 -o logs
synth --excitation multisine --shape periods=1000,duration_s=3 -o logs
synth --excitation chirp --shape frequency_hz=5:1 -o logs
synth --excitation staircase --shape levels=2.5 -o logs
plan fit.json --seed -1
plan fit.json --excitation --seed -1
plan fit.json --excitation --limits rate=1e-9
plan fit.json --excitation --limits rate=3
couple fit.json --idle-drag-nm inf
couple fit.json --limb-spread 0.5
couple fit.json --plants 100000
couple fit.json --seed -1
couple fit.json -o fit.json --force
"""


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small dataset and its fit."""
    where = tmp_path_factory.mktemp("refused")
    made = [
        "synth",
        "--levels",
        "20,40,60,80,100",
        "--repeats",
        "2",
        "--rate-hz",
        "20",
        "--hold",
        "8",
        "--idle",
        "1",
        "-q",
    ]
    assert main.run([*made, "-o", str(where / "data.h5")]) == 0
    assert main.run(["fit", str(where / "data.h5"), "-o", str(where / "fit.json"), "--ci", "none", "-q"]) == 0
    return where


@pytest.mark.parametrize("line", LINES.strip().splitlines())
def test_such_a_call_is_refused_in_one_sentence(
    line: str, rig: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(rig)
    before = {path.name: path.read_bytes() for path in rig.iterdir()}
    assert main.run(shlex.split(line.replace(r"\n", "\n"))) == 2
    said = [one for one in capsys.readouterr().err.splitlines() if one.startswith("error:")]
    assert len(said) == 1
    assert {path.name: path.read_bytes() for path in rig.iterdir()} == before
