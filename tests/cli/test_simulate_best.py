"""`eaid simulate --best` through its runner."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from eaid.cli import main

sys.path.insert(0, str(Path(__file__).parent))
from plain_files import FIT, read_replay


@pytest.fixture
def call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    monkeypatch.chdir(tmp_path)
    Path("fit.json").write_text(json.dumps({**FIT, "linear": {"a0": 1.36, "b0": 0.08, "c0": -2.42}}))
    return ["simulate", "fit.json", "--controller", "open-loop,inverse", "--best"]


def test_each_controller_is_told_how_far_it_is_from_the_best(
    call: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main.run([*call, "--duration", "8", "--json", "-q"]) == 0
    told = json.loads(capsys.readouterr().out)
    best, controllers = told["best"], told["controllers"]
    assert set(controllers) == {"open-loop", "inverse"}
    assert 0 < best["bound_rms_nm"] <= best["rms_error_nm"] <= best["steady_rms_nm"]
    for numbers in controllers.values():
        assert numbers["rms_over_best"] == pytest.approx(numbers["rms_error_nm"] / best["rms_error_nm"])
        assert numbers["rms_over_best"] > 1
    records, _ = read_replay(Path("replay.h5"))
    columns = records["best"].columns
    error = (columns["torque_nm"] - columns["reference_nm"])[5000:]
    assert np.sqrt(np.mean(error**2)) == pytest.approx(best["rms_error_nm"], rel=1e-9)
    first = Path("replay.h5").read_bytes()
    assert main.run([*call, "--duration", "8", "--force"]) == 0
    assert Path("replay.h5").read_bytes() == first
    shown = capsys.readouterr().out
    assert "How far from the best" in shown and "none has less than" in shown


def test_within_reach_the_best_is_no_error(call: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    Path("slow.csv").write_text("time_s,reference_nm\n0,0\n4,2\n6,2\n")
    assert main.run([*call, "--reference", "slow.csv", "--noise-nm", "0.01"]) == 0
    told = capsys.readouterr()
    assert "within the plant's reach: the least error is 0" in told.out and " above" in told.out
    assert "note: the best is the bare plant's" in told.err


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        (["--scenario", "rehab"], "--best: in rehab the reference depends on what the limb does"),
        (["--no-saturation"], "--best: is the best within the duty limits; leave out --no-saturation"),
    ],
)
def test_where_no_best_is_defined(
    call: list[str], more: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main.run([*call, *more]) == 2
    assert capsys.readouterr().err.startswith(f"error: {sentence}") and not Path("replay.h5").exists()
