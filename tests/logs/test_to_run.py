"""One table → one run: instants, levels in names, triggers, units, positions, dropped rows; what is left and told."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from eaid.logs.options import ReadOptions

from eaid.errors import DataError, UsageError
from eaid.logs.folders import Entry, apply
from eaid.logs.frames import runs_from_frames
from eaid.logs.read import _check_level, _checked_run, _refuse_what_does_nothing, _stem
from eaid.logs.run import Run
from eaid.logs.table import BadCell, Cells, Table
from eaid.logs.to_run import Origin, run_of

T = np.arange(100) / 10
U = np.where(T >= 3, 60.0, 0.0)
ON = np.where(T >= 3, 1.0, 0.0)


def made(names: str, *values: np.ndarray, says: str = "log", table: dict[str, object] = {}, **said: object) -> Run:  # noqa: B006
    bad = tuple(BadCell(int(row), k, "") for k, one in enumerate(values) for row in np.flatnonzero(one != one))
    one = Table("", tuple(names.split("|")), lambda wanted: Cells(tuple(values[i] for i in wanted), bad), **table)  # type: ignore[arg-type]
    return run_of(Origin("name", "log.csv", "0", says), [one], ReadOptions(**said))  # type: ignore[arg-type]


def plain(t: np.ndarray = T, u: np.ndarray = U, y: np.ndarray = ON, **said: object) -> Run:
    return made("time|duty|torque_nm", t, u, y, **said)  # type: ignore[arg-type]


def told(run: Run) -> dict[str, dict[str, object]]:
    assert all(one.subject == "name" for one in run.findings)
    return {one.code: dict(one.values) for one in run.findings}


@pytest.mark.parametrize(
    ("said", "since"),
    [(8.0, 3.0), (5.0, 0.0), (14.9, 9.9), (3.0, 3.0), (4.9, 4.9), (9.9, 4.9), (9.8, 4.8), (30.0, 25.0), (-1.0, -6.0),
     (0.0, 0.0)],
)  # fmt: skip
def test_instants_on_the_clock_of_a_log_from_5_to_14_9_s(said: float, since: float) -> None:
    run = plain(T + 5, step_at_s=said, until_s=said)
    assert (run.step_s, run.until_s, run.start_s) == (pytest.approx(since), pytest.approx(since), 5.0)
    assert plain(T + 5).step_s is None and plain(T + 5).until_s is None


@pytest.mark.parametrize(
    ("name", "contradicted"),
    [("u40", True), ("u60", False), ("u61", False), ("u58,9", False), ("u58,8", True), ("u62", True), ("u-60", False)],
)
def test_a_level_in_the_name_within_2_percent_of_the_input(name: str, contradicted: bool) -> None:
    run = plain(says=name, name_pattern="u{level}")
    assert run.level is None and ("level-contradicted" in told(run)) is contradicted
    if name == "u40":
        assert told(run)["level-contradicted"] == {"level": 40.0, "found": 60.0, "unit": "%"}
    back = plain(u=-U, says="u40", name_pattern="u{level}")
    assert told(back)["level-contradicted"]["found"] == -60.0


def test_a_trigger_and_a_level_in_the_name() -> None:
    run = made("time|enable|torque_nm", T, 2 + 3 * ON, ON, says="u40_r2", name_pattern="u{level}_r{repeat}",
               units={"input": "V"})  # fmt: skip
    assert (run.level, run.repeat, run.input_unit, run.kind) == (None, 2, "V", None)
    assert set(run.input.tolist()) == {0.0, 40.0} and (run.input == 40).tolist() == (T >= 3).tolist()
    assert told(run) == {"level-times-trigger": {"column": "enable", "level": 40.0}}
    assert (dict(run.taken)["input"], run.left) == ("enable", ())
    for other in (np.floor(T / 3), np.where(np.arange(100) % 2, 1.0, 0.0), 0 * T):  # four values, no steps, still
        run = made("time|enable|torque_nm", T, other, ON, says="u40", name_pattern="u{level}")
        assert (run.level, run.left, run.has_input) == (40.0, ("enable",), False)
    run = made("time|enable|torque_nm", T, ON, ON)
    assert list(told(run)) == ["input-unnamed", "unit-unknown"] and run.input.max() == 1.0


def test_a_name_that_does_not_match_is_refused_where_nothing_else_says_the_level() -> None:
    still = made("time|x|torque_nm", T, 0 * T, ON, says="u-4.5_r10", name_pattern="u{level}_r{repeat}")
    assert (still.level, still.repeat, still.has_input) == (-4.5, 10, False)
    with pytest.raises(DataError, match="its name does not match"):
        made("time|x|torque_nm", T, 0 * T, ON, says="other", name_pattern="u{level}")
    assert plain(says="other", name_pattern="u{level}").level is None
    assert made("time|x|torque_nm", T, 0 * T, ON).level is None
    repeat = f"r{2**63 - 1}"
    assert plain(says=repeat, name_pattern="r{repeat}").repeat == 2**63 - 1
    with pytest.raises(DataError, match="its repeat, 9223372036854775808, is no count"):
        plain(says=f"r{2**63}", name_pattern="r{repeat}")


def test_sample_numbers_and_a_rate() -> None:
    counted = made("sample|duty|torque_nm", np.arange(7.0, 107.0), U, ON, rate_hz=50.0)
    assert (counted.time_s[0], counted.time_s[-1], counted.start_s) == (0.0, 99 / 50, 0.0)
    assert counted.left == ("sample",) and "time" not in dict(counted.taken)
    known = made("duty|torque_nm", U, ON, table={"rate_hz": 20.0})
    assert known.time_s[-1] == pytest.approx(99 / 20)
    assert made("duty|torque_nm", U, ON, table={"rate_hz": 20.0}, rate_hz=10.0).time_s[-1] == pytest.approx(9.9)
    with pytest.raises(DataError, match="has a time column, time, so rate_hz= does nothing; leave it out"):
        plain(rate_hz=50.0)


def test_positions_keep_their_unit() -> None:
    names, columns = "time|duty|torque_nm|x [mm]", {"position": "4"}
    at = made(names, T, U, ON, 7 * ON, columns=columns)
    assert at.position is not None
    assert (at.position.max(), at.position_unit, dict(at.taken)["position"]) == (7.0, "mm", "x [mm]")
    assert made(names, T, U, ON, ON, columns=columns, units={"position": "cm"}).position_unit == "cm"
    of_file = {"units": ("s", "%", "N·m", "in")}
    assert made(names, T, U, ON, ON, columns=columns, table=of_file).position_unit == "in"
    assert plain().position is None and plain().position_unit == ""


def test_what_is_taken_left_and_said() -> None:
    run = made("time|duty|torque_nm|torque_ref|x", T, U, ON, 2 * ON, T, table={"dropped": tuple("abcdefghij"),
               "said": {"synthetic": "by hand"}})  # fmt: skip
    assert run.taken == (("time", "time"), ("input", "duty"), ("output", "torque_nm"), ("reference", "torque_ref"))
    assert run.left == ("x", *"abcdefghij") and run.synthetic == "by hand"
    assert run.reference_nm is not None and run.reference_nm.max() == 2.0
    assert told(run) == {"columns-without-numbers": {"columns": "a, b, c, d, e, f, g, h"}}
    assert plain().reference_nm is None and plain().findings == () and plain().synthetic is None


@pytest.mark.parametrize(
    ("y", "said", "largest"),
    [(1000.0, {}, None), (1001.0, {}, 1001.0), (-1001.0, {}, 1001.0), (1001.0, {"units": {"output": "Nm"}}, None)],
)
def test_a_torque_beyond_any_clutch(y: float, said: dict[str, object], largest: float | None) -> None:
    found = told(plain(y=y * ON, **said)).get("torque-too-large")
    assert found == (None if largest is None else {"largest": largest})


def test_units_of_counts_booleans_and_unsigned_numbers() -> None:
    counts = plain(u=(200 * ON).astype("u1"), units={"input": "/255"})
    assert (counts.input.max(), counts.input_unit) == (pytest.approx(200 / 2.55), "%")
    assert plain(u=ON > 0).input.tolist() == ON.tolist()
    falls = plain(y=(5 - 3 * ON).astype("u8"))
    assert falls.output.tolist() == (5 - 3 * ON).tolist()
    huge = np.full(100, 2**64 - 1, dtype="u8")
    assert plain(y=huge, units={"output": "counts"}).output[0] == pytest.approx(2.0**64)
    late = plain(t=2**62 + np.arange(100, dtype="u8"), units={"time": "ns"})
    np.testing.assert_allclose(late.time_s, 1e-9 * np.arange(100), rtol=1e-12)


def test_a_speed_in_rad_per_s_is_none_in_rpm() -> None:
    """The s behind the stroke was taken for its unit, and the numbers for RPM."""
    for name in ("speed_rad/s", "speed rad/s", "speed [rad/s]"):
        run = made(f"time|{name}|torque_nm", T, 10 * ON, ON)
        assert (run.input_unit, run.kind, run.findings) == ("RPM", "friction-speed", ())
        assert run.input.max() == pytest.approx(300 / np.pi)


def test_bad_rows_are_told_or_dropped() -> None:
    def without(row: int) -> np.ndarray:
        return np.where(np.arange(100) == row, np.nan, ON)

    with pytest.raises(DataError, match="row 51, column torque_nm, is empty; mend the cell, or drop such rows"):
        plain(y=without(50))
    run = plain(y=without(50), repair=True)
    assert len(run.time_s) == len(run.input) == len(run.output) == 99
    assert told(run) == {"rows-dropped": {"dropped": 1, "count": 100}}
    moved = plain(t=T + 2, y=without(30), repair=True)
    assert told(moved)["step-row-dropped"] == {"row": 31, "at_s": 5.0}
    in_ms = plain(t=1000 * T, y=without(30), repair=True, units={"time": "ms"})
    assert told(in_ms)["step-row-dropped"] == {"row": 31, "at_s": 3.0}
    assert "step-row-dropped" not in told(plain(y=without(30), repair=True, step_at_s=3.0))
    # of columns that are not read nothing is said; of a reference neither
    assert made("time|duty|torque_nm|x", T, U, ON, without(50)).findings == ()
    assert len(made("time|duty|torque_nm|torque_ref", T, U, ON, without(50)).time_s) == 100


def test_the_manifest_says_what_the_log_does_not() -> None:
    run = replace(plain(T + 5), level=None, repeat=7)
    entry = Entry("a.csv", level=30.0, repeat=2, step_s=8.0, until_s=9.0)
    said = apply(entry, run)
    assert (said.level, said.repeat, said.step_s, said.until_s) == (None, 2, 3.0, 4.0)
    unknown = replace(run, input=np.full(100, np.nan), level=10.0)
    assert apply(entry, unknown).level == 30.0 and apply(Entry("a.csv"), unknown).level == 10.0
    kept = apply(Entry("a.csv"), replace(run, step_s=1.0, until_s=2.0))
    assert (kept.repeat, kept.step_s, kept.until_s, kept.findings) == (7, 1.0, 2.0, ())
    for sha256, codes in (("0", []), ("1", ["log-changed"]), (None, [])):
        assert [one.code for one in apply(Entry("a.csv", sha256=sha256), run).findings] == codes
    cut = replace(run, cut=True, repeat=7, step_s=1.0)
    assert (apply(entry, cut).repeat, apply(entry, cut).step_s) == (7, 1.0)


def stored(u: np.ndarray = U, **more: object) -> Run:
    return replace(plain(), **{"input": u, "cut": True, "dataset": "d.h5", "step_s": 3.0, "level": 60.0, **more})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("run", "level"),
    [(stored(), None), (stored(level=-60.0), None), (stored(level=61.2), None), (stored(level=61.3), 61.3),
     (stored(level=58.7), 58.7), (stored(level=0.0), None),  # what it comes from
     (stored(step_s=None, level=9.0), None), (stored(cut=False, level=9.0), None),
     (stored(u=np.full(100, np.nan), level=9.0), None), (stored(u=np.where(T < 3, 60.0, 0.0), edge="falling"), None),
     (stored(u=np.where(T < 3, 60.0, 0.0), edge="falling", level=40.0), 40.0),
     (stored(step_s=20.0, level=9.0), None),  # nothing is recorded behind it
     (stored(step_s=0.0, edge="falling", level=9.0), None), (stored(step_s=0.0, level=9.0), 9.0)],
)  # fmt: skip
def test_a_stored_level_that_the_input_contradicts_is_refused(run: Run, level: float | None) -> None:
    if level is None:
        _check_level(run)
    else:
        with pytest.raises(DataError, match=f"d.h5: run name: its level is {level:g}, its input goes to"):
            _check_level(run)


def test_rows_of_a_dataset_are_checked_like_those_of_a_log() -> None:
    assert _checked_run(stored(), ReadOptions()).findings == ()
    torn = stored(output=np.where(np.arange(100) == 40, np.nan, ON))
    with pytest.raises(DataError, match="d.h5: run name: sample 41, column output, is empty or not a number"):
        _checked_run(torn, ReadOptions())
    kept = _checked_run(torn, ReadOptions(repair=True))
    assert len(kept.time_s) == 99 and told(kept) == {"rows-dropped": {"dropped": 1, "count": 100}}
    unknown = stored(input=np.full(100, np.nan))
    assert _checked_run(unknown, ReadOptions()) is unknown  # no input column is no fault
    with pytest.raises(DataError, match="sample 5, column input"):
        _checked_run(stored(input=np.where(np.arange(100) == 4, np.nan, U)), ReadOptions())


@pytest.mark.parametrize(
    ("name", "said"),
    [("columns", {"columns": {"time": "1"}}), ("units", {"units": {"input": "V"}}), ("step_at", {"step_at_s": 0.0}),
     ("until", {"until_s": 0.0}), ("rate_hz", {"rate_hz": 5.0}), ("variable", {"variable": "x"}),
     ("join", {"join": True}), ("name_pattern", {"name_pattern": "{level}"})],
)  # fmt: skip
def test_options_that_do_nothing_on_datasets(name: str, said: dict[str, object]) -> None:
    options = ReadOptions(**said)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match=f"^{name}=: does nothing on d.h5, a dataset"):
        _refuse_what_does_nothing([stored()], options)
    _refuse_what_does_nothing([stored(), plain()], options)
    _refuse_what_does_nothing([], options)
    _refuse_what_does_nothing([stored()], ReadOptions())


def test_names_of_runs() -> None:
    names = ("a.csv", "a.CSV.gz", "a.b.txt", "a.h5", "a.hdf5", ".csv", "a.mat", "plain", "a.2")
    assert [_stem(Path(name)) for name in names] == ["a", "a", "a.b", "a", "a", ".csv", "a", "plain", "a.2"]


def test_frames() -> None:
    import pandas as pd

    frame = pd.DataFrame({"time_s": T, "duty_pct": U, "torque": ON, "note": "x"})
    frame.attrs["units"] = {"torque": "mN·m"}
    (run,) = runs_from_frames(frame)
    assert (run.name, run.output_unit, run.output.max(), run.left) == ("run", "N·m", 1e-3, ("note",))
    tall = pd.concat([frame.assign(run=2), frame.assign(run=1, torque=2 * ON)])
    assert [one.name for one in runs_from_frames(tall)] == ["2", "1"]
    assert runs_from_frames(frame.drop(columns="time_s").set_index(pd.Index(2 * T, name="time")))[0].time_s[-1] == 19.8
    stamps = pd.DataFrame({"time": np.datetime64("2026-01-01") + (1e9 * T).astype("m8[ns]"), "duty": U, "torque": ON})
    assert runs_from_frames(stamps)[0].time_s[-1] == pytest.approx(9.9)
    stamps.loc[5, "time"] = pd.NaT
    with pytest.raises(DataError, match="run: row 6, column time, is empty or not a number"):
        runs_from_frames(stamps)
    with pytest.raises(DataError, match="a: the DataFrame is empty; give rows"):
        runs_from_frames({"a": frame[:0]})
    with pytest.raises(DataError, match="several columns have one name"):
        runs_from_frames(pd.concat([frame, frame], axis=1))
    other = frame.assign(torque=ON + 1e-9)
    other.attrs = frame.attrs
    assert len(runs_from_frames({"a": frame, "b": other})) == 2 and len(runs_from_frames({"a": frame, "b": frame})) == 1


def test_rows_of_a_frame_that_belong_to_no_run_are_not_lost_in_silence() -> None:
    import pandas as pd

    frame = pd.DataFrame({"time_s": T, "duty_pct": U, "torque_nm": ON, "run": "a"})
    frame.loc[[3, 7], "run"] = None
    with pytest.raises(
        DataError, match="2 of 100 rows have no name in the column run; say of each row which run it is of"
    ):
        runs_from_frames(frame)
