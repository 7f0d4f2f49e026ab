"""Which column is taken for what, of DataFrames and of tables without names: by their names, then by what moves."""

import numpy as np
import pandas as pd
import pytest
from logs_written import frame, text

import eaid
from eaid import DataError

T = np.arange(60.0) / 10
STEP = np.where(np.arange(60) >= 30, 1.0, 0.0)
COLUMNS = {
    "+": STEP, "#": np.repeat([0.0, 5.0, 9.0], 20), "~": np.sin(np.arange(60.0)), "=": 0 * T, "/": 100 + T / 60, ">": T,
    "?": np.array(["a", "b"] * 30), "-": -STEP, "1": 1 + 0.24 * STEP, "2": 1 + 0.26 * STEP,
}  # fmt: skip
"""A step, holds of three values, what wanders, stands still, creeps, rises, words, a step down, small steps from 1."""


def columns(names: str) -> pd.DataFrame:
    """Columns by their names, each behind the mark of what it does; a bare name rises where it comes first, else it
    wanders."""
    parts = [name if name[0] in COLUMNS else ("~" if i else ">") + name for i, name in enumerate(names.split("|"))]
    return frame("|".join(name[1:] for name in parts), *(COLUMNS[name[0]] for name in parts))


FORCE, SPEED = {"kind": "friction-force"}, {"kind": "friction-speed"}
PLAIN = {"time": "time", "input": "duty", "output": "torque"}


@pytest.mark.parametrize(
    ("names", "said", "expected"),
    [
        ("time|+duty|torque", {}, {}), ("time|+duty|torque|torque_ref", {}, {"reference": "torque_ref"}),
        ("time|+duty|torque|ref", {}, {"reference": "ref"}),
        ("time|+duty|torque|setpoint", {}, {"left": "setpoint"}),  # of the torque, or of something else
        ("time|+duty|torque|ref torque|desired torque", {}, {"left": "ref torque, desired torque"}),
        ("time|+duty|torque|ref torque|desired torque", {"reference": "5"},
         {"reference": "desired torque", "left": "ref torque"}),
        ("time|+command|torque|setpoint", {}, {"input": "command", "left": "setpoint"}),
        ("time|+input|torque_ref|torque|desired", {}, {"input": "input", "reference": "torque_ref", "left": "desired"}),
        ("t [s]|T [degC]|+u|torque", {}, {"time": "t [s]", "input": "u", "left": "T [degC]"}),
        ("clock|b [ms]|+duty|torque", {}, {"time": "clock", "left": "b [ms]"}),
        ("a [ms]|>b [ms]|+duty|torque", {"time": "b"}, {"time": "b [ms]", "left": "a [ms]"}),
        ("time|+motor pwm|torque", {}, {"input": "motor pwm"}),
        ("time|fn x|torque", {}, {"input": None, "left": "fn x"}),  # two letters are no word
        ("time|+duty|torque1", {}, {"output": "torque1"}), ("time|+duty|M [Nm]", {}, {"output": "M [Nm]"}),
        ("time|=enable|torque", {}, {"input": None, "left": "enable"}),
        ("time|trigger|+duty|torque", {}, {"left": "trigger"}),
        ("time|setpoint [Nm]|+duty|torque_nm", {}, {"output": "torque_nm", "reference": "setpoint [Nm]"}),
        ("time|setpoint [V]|+duty|torque_nm", {}, {"output": "torque_nm", "left": "setpoint [V]"}),
        ("time|+command [Nm]|torque_nm", {}, {"input": None, "output": "torque_nm", "reference": "command [Nm]"}),
        ("time|+command [V]|load cell [V]", {}, {"input": "command [V]", "output": "load cell [V]"}),
        ("time|command [V]|+duty|load cell [V]", {}, {"output": "load cell [V]", "reference": "command [V]"}),
        ("time|+command [Nm]|torque_nm", {"input": "command"}, {"input": "command [Nm]", "output": "torque_nm"}),
        ("time|+command [Nm]|duty|torque_nm", {"input": "command"},
         {"input": "command [Nm]", "output": "torque_nm", "left": "duty"}),
        ("time|+duty|torque|x", {"position": "x"}, {"position": "x"}),
        ("time|duty|torque|+force", {"input": "force"}, {"input": "force", "left": "duty", **FORCE}),
        ("time|+duty|friction [N]|force [N]|rpm", {}, {"output": "friction [N]", "left": "force [N], rpm"}),
        ("time|+duty|force [N]", {}, {"output": "force [N]"}),
        ("time|+voltage|+current|torque", {}, {"input": "voltage", "left": "current"}),
        ("time|speed ref|+speed|torque", {}, {"input": "speed", "left": "speed ref", **SPEED}),
        ("+duty|>time|torque", {"time": "2", "input": "1", "output": "3"}, {}),
        ("Time|>time|+duty|torque", {"time": "time"}, {"left": "Time"}),
        ("time|+duty|torque|x", {"output": "X"}, {"output": "x", "left": "torque"}),
        ("Zeit|+Strom|Drehmoment", {}, {"time": "Zeit", "input": "Strom", "output": "Drehmoment"}),
        ("time|+pressure|load cell", {}, {"input": "pressure", "output": "load cell", **FORCE}),
        ("time|+duty|torque|?note|?who", {}, {"left": "note, who"}),
        # a single input stays, however still it is, where nothing else is there: a reference that steps is none
        ("time|=duty|+torque|+torque_ref", {}, {"reference": "torque_ref"}), ("time|=duty|+torque", {}, {}),
        ("time|/speed|+torque", {}, {"input": "speed", **SPEED}),
        ("time|+duty|torque|+x", {}, {"left": "x"}), ("time|=duty|torque|+x|+z", {}, {"left": "x, z"}),
        ("time|x|torque", {}, {"input": None, "left": "x"}),
        ("time|+enable|+gate|torque", {}, {"input": None, "left": "enable, gate"}),
        ("time|speed|torque|+x", {}, {"input": "speed", "left": "x", **SPEED}),
        # a velocity is no voltage, and one along a line no input of a friction rig
        ("time|+v|torque", {}, {"input": None, "left": "v"}), ("time|+V|torque", {}, {"input": "V"}),
        ("time|+V [m/s]|torque|+pos", {}, {"input": None, "left": "V [m/s], pos"}),
        ("time|+Velocity (m/s)|torque", {}, {"input": None, "left": "Velocity (m/s)"}),
        # of several kinds, the one that moves; the duty where none does
        ("time|=duty|torque|+force|/rpm", {}, {"input": "force", "left": "duty, rpm", **FORCE}),
        ("time|=duty|torque|=force|/rpm", {}, {"left": "force, rpm"}),
        # an input that is said is taken as it is
        ("time|torque|=force|+rpm|+x", {"input": "force"}, {"input": "force", "left": "rpm, x", **FORCE}),
        ("time|+Kraft 1|torque", {"input": "Kraft 1"}, {"input": "Kraft 1", **FORCE}),
        ("time|+x [rpm]|torque", {"input": "x"}, {"input": "x [rpm]", **SPEED}),
        ("time|+x [V]|torque", {"input": "x"}, {"input": "x [V]"}), ("time|+x|torque", {"input": "x"}, {"input": "x"}),
    ],
)  # fmt: skip
def test_columns_by_name_and_by_what_moves(names, said, expected, read, codes):
    run = read(columns(names), columns=said)
    wanted = {role: name for role, name in (PLAIN | expected).items() if name is not None}
    kind = wanted.pop("kind", "clutch" if "input" in wanted else None)
    code, left = wanted.pop("code", None), wanted.pop("left", "")
    assert (dict(run.taken), ", ".join(run.left), run.kind) == (wanted, left, kind)
    assert [one for one in codes(run) if not one.startswith("unit-")] == ([code] if code else [])


SAY = "say which with «columns» "


@pytest.mark.parametrize(
    ("names", "said", "sentence"),
    [
        ("a [ms]|>b [ms]|duty|torque", {}, "no column is called time (columns: a [ms], b [ms], duty, torque); name it"),
        ("time|duty|M [Nm]|N [Nm]", {}, f'several columns may be the output (M [Nm], N [Nm]); {SAY}output="M [Nm]"'),
        ("time|u [V]|x", {}, "no column is called torque, force … (columns: time, u [V], x); name what "
                             "was measured with «columns» output=NAME"),
        ("time|duty|torque", {"output": "4"}, "has no column 4 for «columns» output=4; its columns are time, duty, "),
        ("time|duty|torque", {"output": "u[3]"}, "has no column u[3] for"),
        ("Time|>TIME|duty|torque", {"time": "time"}, "has no column time for «columns» time=time; its columns are Ti"),
        ("|".join(["time", *(f"c{k}" for k in range(12)), "torque"]), {"input": "x"},
         "its columns are time, c0, c1, c2, c3, c4, c5, c6, c7, c8, c9, c10 and 2 more (a number counts them from 1)"),
    ],
)  # fmt: skip
def test_names_that_leave_a_choice_are_refused(names, said, sentence, read):
    assert sentence in read.refused(columns(names), columns=said)[0]


def test_a_kind_that_is_said_leaves_only_its_inputs(read):
    for kind, name in (("clutch", "duty"), ("friction-force", "force"), ("friction-speed", "rpm")):
        run = read(columns("time|+duty|torque|+force|+rpm"), kind=kind)
        assert (dict(run.taken)["input"], run.kind, len(run.left)) == (name, kind, 2)


WANDERS = COLUMNS["~"]


@pytest.mark.parametrize(
    ("values", "said", "expected"),
    [
        ([T, STEP, WANDERS], {}, None), ([T, WANDERS], {}, "time, output"),
        ([STEP, WANDERS], {"rate_hz": 5.0}, "input, output"), ([WANDERS], {"rate_hz": 5.0}, "output"),
        ([T, T, WANDERS], {}, None),
        ([WANDERS, STEP, T], {}, None), ([T, T, STEP, WANDERS], {}, None), ([WANDERS, T], {}, None), ([T], {}, None),
    ],
)  # fmt: skip
def test_columns_without_names(values, said, expected, read):
    log = text(None, *values)
    if expected is None:
        told = read.refused(log, **said)[0]
        assert told.startswith(f"its {len(values)} columns have no names; say by number, from 1 to {len(values)}, what")
        return
    run = read(log, **said)
    assert run.findings[0].code == "columns-by-place" and run.findings[0].values["order"] == expected
    for role, column in zip(expected.split(", "), values, strict=True):
        assert role == "time" or np.allclose(getattr(run, role), column, rtol=0, atol=1e-14)
    kinds = {read(log, kind=kind, **said).kind for kind in ("friction-speed", None)}
    assert kinds == ({"friction-speed", "clutch"} if "input" in expected else {"friction-speed", None})


T2 = np.arange(800) / 200
U2 = np.where(T2 >= 1, 60.0, 0.0)
Y2 = np.round(np.where(T2 >= 1, -2.0 * np.expm1(-(T2 - 1) / 0.3), 0.0) + 2e-3 * np.sin(1e4 * T2), 6)


def test_frames_go_the_way_of_logs(read):
    frames = {name: frame("time_s|duty_pct|torque_nm", T2, k * U2, k * Y2) for name, k in (("x", 1.0), ("y", 0.5))}
    log = read(frames["x"].to_csv(index=False), "x.csv")
    for given in (frames, pd.concat([one.assign(run=name) for name, one in frames.items()])):
        runs = read.all(given)
        assert [(run.name, run.input_unit, run.output_unit, run.kind) for run in runs] == [
            (name, "%", "N·m", "clutch") for name in frames
        ]
        for run, k in zip(runs, (1.0, 0.5), strict=True):
            np.testing.assert_allclose((run.time_s, run.input, run.output), (T2, k * U2, k * Y2), atol=1e-12)
        assert (log.taken, log.left, log.findings) == (runs[0].taken, runs[0].left, runs[0].findings)
    assert eaid.read(frames["x"]).runs[0].name == "run"
    numbered = pd.concat([frames["x"].assign(run=2), frames["y"].assign(run=1)])
    assert [run.name for run in read.all(numbered)] == ["2", "1"]


def test_stamps_units_and_an_index_of_frames(read):
    at = pd.Timestamp("2024-01-01", tz="Europe/Berlin") + pd.to_timedelta(T2, unit="s")
    columns = {"duty": U2, "torque": 1e3 * Y2, "note": "x"}
    for index in (at, at.tz_localize(None), pd.to_timedelta(T2, unit="s"), T2):
        given = pd.DataFrame(columns, index=pd.Index(index, name="time"))
        given.attrs["units"] = {"torque": "mN·m"}
        run = read(given)
        np.testing.assert_allclose(run.time_s, T2, atol=1e-9)
        np.testing.assert_allclose(run.output, Y2, atol=1e-12)
        assert (run.output_unit, run.left) == ("N·m", ("note",))


def test_bad_frames_are_told_all_at_once(read):
    good = frame("time_s|duty_pct|torque_nm", T2, U2, Y2)
    torn, late = good.copy(), good.assign(time_s=np.datetime64("2026-01-01") + (1e9 * T2).astype("m8[ns]"))
    torn.loc[[7, 8], "torque_nm"] = [np.nan, np.inf]
    late.loc[5, "time_s"] = pd.NaT
    unnamed = good.assign(run=["a"] * 798 + [None] * 2)
    frames = {"x": torn, "y": good.drop(columns="torque_nm"), "z": good, "e": good[:0],
              "d": pd.concat([good, good], axis=1), "n": late}  # fmt: skip
    with pytest.raises(DataError) as caught:
        eaid.read(frames)
    assert [said.split("; ")[0] for said in caught.value.sentences] == [
        "x: row 8, column torque_nm, is empty or not a number", "x: row 9, column torque_nm, is infinite",
        "y: no column is called torque, force … (columns: time_s, duty_pct)", "e: the DataFrame is empty",
        "d: several columns have one name", "n: row 6, column time_s, is empty or not a number",
    ]  # fmt: skip
    with pytest.raises(DataError, match="2 of 800 rows have no name in the column run; say of each row which run it"):
        eaid.read(unnamed)


def test_numbers_of_any_type(read):
    """Whole numbers without a sign, truths, and counts beyond the largest whole number keep their value."""
    counts = read(frame("time|duty|torque_nm", T, (200 * STEP).astype("u1"), STEP), units={"input": "/255"})
    assert (counts.input.max(), counts.input_unit) == (pytest.approx(200 / 2.55), "%")
    assert read(frame("time|duty|y", T, STEP > 0, STEP)).input.tolist() == STEP.tolist()
    for kind in ("u8", "i8", "f8", "f4", "u2"):
        falls = read(frame("time|duty|y", T, STEP, (5 - 3 * STEP).astype(kind)))
        assert falls.output.tolist() == (5 - 3 * STEP).tolist() and falls.output.dtype == np.float64
    huge = read(frame("time|duty|y", T, STEP, np.where(STEP, np.uint64(2**64 - 1), np.uint64(2**63))))
    assert huge.output[[0, -1]].tolist() == [2.0**63, 2.0**64]
    late = read(frame("time|duty|y", 2**62 + np.arange(60, dtype="u8"), STEP, STEP), units={"time": "ns"})
    np.testing.assert_allclose(late.time_s, 1e-9 * np.arange(60), rtol=1e-12)


def test_positions_keep_their_unit(read):
    names, said = "time|duty|torque_nm|x [mm]", {"columns": {"position": "4"}}
    run = read(frame(names, T, STEP, STEP, 7 * STEP), **said)
    assert (run.position.max(), run.position_unit, dict(run.taken)["position"]) == (7.0, "mm", "x [mm]")
    assert read(frame(names, T, STEP, STEP, STEP), units={"position": "cm"}, **said).position_unit == "cm"
    assert read(frame(names, T, STEP, STEP, STEP, units={"x [mm]": "in"}), **said).position_unit == "in"
    plain = read(columns("time|+duty|torque"))
    assert (plain.position, plain.position_unit, plain.reference_nm, plain.synthetic) == (None, "", None, None)


@pytest.mark.parametrize(
    ("holds", "recorded"),
    [([0, 20, 40, 0], True), ([0, 50, 49.5, 0], False), ([0, 50, 48.1, 0], False), ([0, 50, 47.9, 0], True),
     ([0, 50, 0], False),
     ([0, 50] * 4 + [0], False), ([20, 40, 20, 40], True), ([0, 1, 50, 50, 0], False), ([0, -20, -40, 0], True)],
)  # fmt: skip
def test_which_logs_are_fitted_as_they_were_recorded(holds, recorded):
    """Those whose input does more than step from rest."""
    u = np.repeat(np.array(holds, dtype=float), 100)
    data = frame("time|voltage|torque" if min(holds) < 0 else "time|duty|torque", np.arange(len(u)) / 10, u,
                 u + 0.01 * np.sin(1e3 * np.arange(len(u))))  # fmt: skip
    assert bool(eaid.read(data).recorded) is recorded
    assert not eaid.read(data, logs_as="steps").recorded and eaid.read(data, logs_as="recorded").recorded


@pytest.mark.parametrize(
    ("hold", "rest", "falls", "recorded"),
    [(100, 20, 5, True), (100, 20, 4, False), (100, 100, 5, False), (100, 99, 5, True)],
)
def test_short_rests_between_many_falls_are_a_recording(hold, rest, falls, recorded):
    u = np.concatenate([*[np.zeros(rest), np.full(hold, 50.0)] * falls, np.zeros(rest)])
    data = frame("time|duty|torque", np.arange(len(u)) / 10, u, u + 0.01 * np.sin(1e3 * np.arange(len(u))))
    assert bool(eaid.read(data).recorded) is recorded


def test_an_input_that_stands_still_is_no_input_where_another_steps(read):
    """A tribometer at a constant force, whose speed steps: the force was taken, "20 → 20 N", usable."""
    held = {"Time (s)": T, "Normal force (N)": 20 + 0.05 * np.sin(np.arange(len(T)))}
    log = {**held, "Sliding speed (mm/s)": 10 * np.array(STEP), "Friction force (N)": WANDERS}
    (said,) = read.refused(pd.DataFrame(log))
    assert "Normal force (N) stands still, and Sliding speed (mm/s) steps" in said
    for given in ("Sliding speed (mm/s)", "Normal force (N)"):
        assert dict(read(pd.DataFrame(log), columns={"input": given}).taken)["input"] == given
    assert dict(read(pd.DataFrame({**log, "Sliding speed (mm/s)": 3.0})).taken)["input"] == "Normal force (N)"
