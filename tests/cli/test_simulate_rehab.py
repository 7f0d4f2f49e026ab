"""`eaid simulate --scenario rehab` through its runner."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from eaid.cli import main

sys.path.insert(0, str(Path(__file__).parent))
from plain_files import FIT, GAINS, read_replay


@pytest.fixture
def call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    monkeypatch.chdir(tmp_path)
    Path("fit.json").write_text(json.dumps(FIT))
    Path("gains.json").write_text(json.dumps({key: part for key, part in GAINS.items() if key != "pi"}))
    return ["simulate", "fit.json", "--gains", "gains.json", "--scenario", "rehab"]


def test_a_session_its_file_and_its_json(call: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run([*call, "--json", "-q"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["scenario"] == "rehab" and told["uncounted_s"] == 5.0 and told["damping_nms"] == 0.8
    rc = told["controllers"]["rc"]
    assert 2 < rc["modes"]["soft"]["abs_position_error_deg"]["median"] < 4
    assert rc["max_abs_error_nm"] >= rc["rms_error_nm"] > 0 and len(rc["tests"]) == 3
    records, head = read_replay(Path("replay.h5"))
    columns = records["rc"].columns
    assert head.scenario == "rehab" and len(columns["time_s"]) == 90_000
    assert {"angle_deg", "target_deg", "desired_nm", "rendered_nm", "mode", "position_error_deg"} <= set(columns)
    np.testing.assert_array_equal(np.abs(columns["rendered_nm"]), columns["torque_nm"])
    assert sorted(set(columns["mode"])) == [0, 1, 2]
    first = Path("replay.h5").read_bytes()
    assert main.run([*call, "--force"]) == 0
    assert Path("replay.h5").read_bytes() == first
    shown = capsys.readouterr().out
    assert "hard and assisted" in shown and "< 1e−300" in shown


def test_a_diverging_session_is_refused_and_leaves_nothing(call: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run([*call, "--limb-damping", "0.5", "--seed", "1"]) == 5
    told = capsys.readouterr().err
    assert told.startswith("error: rehab with rc: the ") and "diverges" in told and told.count("\n") == 1
    assert not Path("replay.h5").exists()


def test_options_of_the_limb_belong_to_rehab(call: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run([*call[:-1], "steps", "--limb-damping", "0.5"]) == 2
    assert capsys.readouterr().err.startswith("error: --limb-damping and --limb-inertia belong to --scenario rehab")
