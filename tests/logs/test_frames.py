"""DataFrames go the way of logs: the same runs, the same refusals."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from eaid.logs.options import ReadOptions

from eaid.errors import DataError
from eaid.logs.frames import runs_from_frames
from eaid.logs.read import read_runs
from eaid.logs.run import Run

T = np.arange(800) / 200
U = np.where(T >= 1, 60.0, 0.0)
Y = np.round(np.where(T >= 1, -2.0 * np.expm1(-(T - 1) / 0.3), 0.0) + 2e-3 * np.sin(1e4 * T), 6)


def frame(level: float = 60.0) -> pd.DataFrame:
    return pd.DataFrame({"time_s": T, "duty_pct": U * level / 60, "torque_nm": Y * level / 60})


def same_run(one: Run, other: Run) -> None:
    for name in ("time_s", "input", "output"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), atol=1e-9)
    assert (one.input_unit, one.output_unit, one.kind) == (other.input_unit, other.output_unit, other.kind)


def test_frames_go_the_way_of_logs(tmp_path: Path) -> None:
    frame().to_csv(tmp_path / "a.csv", index=False)
    (log,) = read_runs([tmp_path / "a.csv"])
    runs = runs_from_frames({"x": frame(), "y": frame(30.0)})
    assert [run.name for run in runs] == ["x", "y"]
    same_run(runs[0], log)
    tall = pd.concat([frame().assign(run="x"), frame(30.0).assign(run="y")])
    for one, other in zip(runs_from_frames(tall), runs, strict=True):
        assert one.name == other.name
        same_run(one, other)
    (alone,) = runs_from_frames(frame())
    same_run(alone, log)


def test_frames_with_stamps_units_and_an_index(tmp_path: Path) -> None:
    at = pd.Timestamp("2024-01-01", tz="Europe/Berlin") + pd.to_timedelta(T, unit="s")
    given = pd.DataFrame({"duty": U, "torque": 1e3 * Y, "note": "x"}, index=pd.Index(at, name="time"))
    given.attrs["units"] = {"torque": "mN·m"}
    (run,) = runs_from_frames({"a_u60_": given}, ReadOptions(units={"input": "%"}))
    np.testing.assert_allclose(run.time_s, T, atol=1e-9)
    np.testing.assert_allclose(run.output, Y, atol=1e-12)
    assert run.output_unit == "N·m"
    assert run.left == ("note",)


def test_bad_frames_are_told_all_at_once() -> None:
    bad = frame()
    bad.loc[7, "torque_nm"] = np.nan
    with pytest.raises(DataError) as caught:
        runs_from_frames({"x": bad, "y": frame().drop(columns="torque_nm"), "z": frame()})
    assert [said.split(";")[0] for said in caught.value.sentences] == [
        "x: row 8, column torque_nm, is empty or not a number",
        "y: no column is called torque (columns: time_s, duty_pct)",
    ]


def test_the_same_frame_twice_counts_once() -> None:
    (run,) = runs_from_frames({"x": frame(), "y": frame()})
    assert "log-given-twice" in {one.code for one in run.findings}
