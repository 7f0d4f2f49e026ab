"""Which column is taken for what, by the names of all of them: the one that is meant, among those that look like it."""

import numpy as np
import pytest
from eaid.logs.options import ReadOptions

from eaid.errors import DataError, EaidError
from eaid.logs.columns import INPUTS, OUTPUTS, by_place, default_unit, kind_of, match_columns, the_input
from eaid.logs.read import NOTHING_SAID
from eaid.logs.table import Cells, Table


def sheet(names: str, **more: object) -> Table:
    return Table("", tuple(names.split("|")), lambda _: Cells(()), **more)  # type: ignore[arg-type]


def roles(table: Table, options: ReadOptions) -> dict[str, str]:
    """Role → column; `left`: those without a role."""
    found = match_columns("log", table, options)
    one = {role: getattr(found, role) for role in ("time", "output", "reference", "trigger", "position")}
    named = {role: table.columns[at] for role, at in one.items() if at is not None}
    named |= {kind: table.columns[at] for kind, at in found.inputs}
    return named | {"left": "|".join(table.columns[at] for at in found.others)}


PLAIN = {"time": "time", "clutch": "duty", "output": "torque", "left": ""}


@pytest.mark.parametrize(
    ("names", "said", "expected"),
    [
        ("time|duty|torque", {}, {}),
        ("time|duty|torque|torque_ref", {}, {"reference": "torque_ref"}),
        ("time|duty|torque|ref", {}, {"reference": "ref"}),
        ("time|duty|torque|setpoint", {}, {"left": "setpoint"}),  # of the torque, or of something else
        ("time|duty|torque|ref torque|desired torque", {}, {}),  # neither of the two, and no input either
        ("time|duty|torque|ref torque|desired torque", {"reference": "5"}, {"reference": "desired torque"}),
        ("time|command|torque|setpoint", {}, {"clutch": "command", "left": "setpoint"}),
        ("time|input|torque_ref|torque|desired", {},
         {"clutch": "input", "reference": "torque_ref", "left": "desired"}),
        ("t [s]|T [degC]|u|torque", {}, {"time": "t [s]", "clutch": "u", "left": "T [degC]"}),
        ("t [s]|t2 [s]|duty|torque", {}, {"time": "t [s]", "left": "t2 [s]"}),
        ("clock a|b [ms]|duty|torque", {}, {"time": "clock a", "left": "b [ms]"}),
        ("a [ms]|duty|torque", {}, {"time": "a [ms]"}),
        ("a [ms]|b [ms]|duty|torque", {"time": "b"}, {"time": "b [ms]", "left": "a [ms]"}),
        ("time|motor pwm|torque", {}, {"clutch": "motor pwm"}),
        ("time|fn x|torque", {}, {"clutch": None, "left": "fn x"}),  # two letters are no word
        ("time|duty|torque1", {}, {"output": "torque1"}),
        ("time|duty|M [Nm]", {}, {"output": "M [Nm]"}),
        ("time|duty|M [Nm]|N [Nm]", {"output": "N"}, {"output": "N [Nm]", "left": "M [Nm]"}),
        ("time|enable|torque", {}, {"clutch": None, "trigger": "enable", "left": "enable"}),
        ("time|enable|gate|torque", {}, {"clutch": None, "left": "enable|gate"}),
        ("time|trigger|duty|torque", {}, {"left": "trigger"}),
        ("time|setpoint [Nm]|duty|torque_nm", {}, {"output": "torque_nm", "reference": "setpoint [Nm]"}),
        ("time|setpoint [V]|duty|torque_nm", {}, {"output": "torque_nm", "left": "setpoint [V]"}),
        ("time|command [Nm]|torque_nm", {}, {"clutch": None, "output": "torque_nm", "reference": "command [Nm]"}),
        ("time|command [Nm]|torque_nm", {"input": "command"}, {"clutch": "command [Nm]", "output": "torque_nm"}),
        ("time|command [Nm]|duty|torque_nm", {"input": "command"},
         {"clutch": "command [Nm]", "output": "torque_nm", "left": "duty"}),
        ("time|duty|torque|x", {"position": "x"}, {"position": "x"}),
        ("time|duty|torque|force", {"input": "force"}, {"clutch": None, "friction-force": "force", "left": "duty"}),
        ("time|duty|torque|force|rpm", {}, {"friction-force": "force", "friction-speed": "rpm"}),
        ("time|duty|friction [N]|force [N]|rpm", {},
         {"output": "friction [N]", "friction-force": "force [N]", "friction-speed": "rpm"}),
        ("time|duty|force [N]", {}, {"output": "force [N]"}),
        ("time|voltage|current|torque", {}, {"clutch": "voltage", "left": "current"}),
        ("time|speed ref|speed|torque", {}, {"clutch": None, "friction-speed": "speed", "left": "speed ref"}),
        ("time|duty|torque", {"time": "1", "input": "2", "output": "3"}, {}),
        ("Time|time|duty|torque", {"time": "time"}, {"time": "time", "left": "Time"}),
        ("time|DUTY [%]|torque", {"input": "duty"}, {"clutch": "DUTY [%]"}),
    ],
)  # fmt: skip
def test_roles_by_name(names: str, said: dict[str, str], expected: dict[str, str | None]) -> None:
    found = roles(sheet(names), ReadOptions(columns=said))
    assert found == {role: name for role, name in (PLAIN | expected).items() if name is not None}


@pytest.mark.parametrize(
    ("names", "said", "sentence"),
    [
        ("t|time_ms|duty|torque", {}, 'several columns may be the time (t, time_ms); say which with «columns» time='),
        ("a [ms]|b [ms]|duty|torque", {}, "no column is called time (columns: a [ms], b [ms], duty, torque)"),
        ("sample|torque", {}, "no column is called time (columns: sample, torque)"),
        ("time|duty|torque1|torque2", {}, "several columns may be the output (torque1, torque2)"),
        ("time|duty|M [Nm]|N [Nm]", {}, 'several columns may be the output (M [Nm], N [Nm]); say which with «columns» '
                                        'output="M [Nm]"'),
        ("time|duty|pwm|torque", {}, 'several columns may be the input (duty, pwm); say which with «columns» input='),
        ("time|u [V]|x", {}, 'name what was measured with «columns» output="x"'),
        ("time|u [V]|x|z", {}, "name what was measured with «columns» output=NAME"),
        ("time|x [V]|z", {}, 'name what was measured with «columns» output="z"'),
        ("time|duty|x [A]", {}, "name what was measured with «columns» output=NAME"),
        ("time|duty|torque", {"output": "4"}, "has no column 4 for «columns» output=4; its columns are time, duty,"),
        ("time|duty|torque", {"output": "0"}, "has no column 0"),
        ("time|duty|torque", {"output": "u[3]"}, "has no column u[3]"),
        ("Time|TIME|duty|torque", {"time": "time"}, "has no column time for «columns» time=time"),
        ("time|duty|torque", {"time": "1", "output": "1"}, "«columns»: output and time are the same column, time"),
    ],
)  # fmt: skip
def test_names_that_leave_a_choice_are_refused(names: str, said: dict[str, str], sentence: str) -> None:
    with pytest.raises(EaidError) as fault:
        match_columns("log", sheet(names), ReadOptions(columns=said))
    assert sentence in fault.value.sentences[0]


def test_a_rate_stands_for_the_time() -> None:
    for table, options in (
        (sheet("duty|torque"), ReadOptions(rate_hz=100.0)),
        (sheet("duty|torque", rate_hz=100.0), ReadOptions()),
    ):
        assert roles(table, options) == {"clutch": "duty", "output": "torque", "left": ""}
    with pytest.raises(DataError, match="no column is called time"):
        match_columns("log", sheet("duty|torque"), ReadOptions())


def test_a_format_that_knows_its_time_and_units() -> None:
    assert roles(sheet("x|duty|torque", clock=0), ReadOptions())["time"] == "x"
    assert roles(sheet("time|x|duty|torque", clock=1), ReadOptions())["time"] == "x"
    assert roles(sheet("x|duty|y", units=("ms", "%", "Nm")), ReadOptions()) == PLAIN | {"time": "x", "output": "y"}
    assert roles(sheet("x|duty|m", units=("ms", "%", "Nm")), ReadOptions()) == PLAIN | {"time": "x", "output": "m"}


def test_a_column_of_a_matrix_is_named_by_its_number() -> None:
    table = Table("u", ("time", "duty", "torque"), lambda _: Cells(()))
    options = ReadOptions(columns={"time": "u[1]", "input": "u[2]", "output": "3"})
    assert roles(table, options) == PLAIN


@pytest.mark.parametrize("kind", ["clutch", "friction-force", "friction-speed"])
def test_a_kind_that_is_said_leaves_only_its_inputs(kind: str) -> None:
    column = {"clutch": "duty", "friction-force": "force", "friction-speed": "rpm"}
    found = match_columns("log", sheet("time|duty|torque|force|rpm"), ReadOptions(kind=kind))  # type: ignore[arg-type]
    assert [(one, ("time", "duty", "torque", "force", "rpm")[at]) for one, at in found.inputs] == [(kind, column[kind])]
    assert len(found.others) == 2


@pytest.mark.parametrize(
    ("name", "unit", "kind"),
    [("duty", "", "clutch"), ("Kraft", "", "friction-force"), ("omega", "", "friction-speed"),
     ("x [N]", "", "friction-force"), ("x [bar]", "", "friction-force"), ("x [rpm]", "", "friction-speed"),
     ("x", "rad/s", "friction-speed"), ("x", "kPa", "friction-force"), ("x", "V", "clutch"), ("x", "", "clutch"),
     ("x [N]", "V", "clutch"), ("x", "/255", "clutch")],
)  # fmt: skip
def test_the_kind_that_an_input_means(name: str, unit: str, kind: str) -> None:
    assert kind_of(name, unit) == kind


def test_units_that_names_imply() -> None:
    outputs = {name: default_unit(name, OUTPUTS) for name in ("torque", "friction", "load cell", "y", "what")}
    assert outputs == {"torque": "", "friction": "N", "load cell": "N", "y": "", "what": ""}
    inputs = {name: default_unit(name, INPUTS["clutch"]) for name in ("duty", "u", "volts", "strom")}
    assert inputs == {"duty": "%", "u": "%", "volts": "V", "strom": ""}


STILL = np.zeros(60)
STEP = np.where(np.arange(60) >= 30, 1.0, 0.0)
HOLDS = np.repeat([0.0, 5.0, 9.0], 20)
WANDERS = np.sin(np.arange(60.0))
SPEED = 100.0 + np.arange(60) / 60.0


def taken(names: str, values: list[np.ndarray], options: ReadOptions = NOTHING_SAID, known: bool = False):
    """Kind and name of the input that is taken, and the codes of what is said about it."""
    table = sheet(names)
    found = match_columns("log", table, options)
    kind, which, findings = the_input("log", table, found, values.__getitem__, known)
    return kind, None if which is None else table.columns[which], [one.code for one in findings]


@pytest.mark.parametrize(
    ("names", "values", "expected"),
    [
        # a single input stays, however still it is, where nothing else is there: a reference that steps is none
        ("time|duty|torque", [STILL] * 3, ("clutch", "duty", [])),
        ("time|duty|torque|torque_ref", [STILL, STILL, STEP, STEP], ("clutch", "duty", [])),
        ("time|speed|torque", [STILL, SPEED, STEP], ("friction-speed", "speed", [])),
        # another column that steps, where none that is called an input does
        ("time|duty|torque|x", [STILL, STILL, WANDERS, STEP], ("clutch", "x", ["input-by-its-steps"])),
        ("time|duty|torque|x", [STILL, STEP, WANDERS, STEP], ("clutch", "duty", [])),
        ("time|duty|torque|x|z", [STILL, STILL, WANDERS, STEP, STEP], ("clutch", "duty", [])),
        ("time|x|torque", [STILL, STEP, WANDERS], ("clutch", "x", ["input-unnamed"])),
        ("time|x [rpm]|torque", [STILL, STEP, WANDERS], ("friction-speed", "x [rpm]", ["input-unnamed"])),
        ("time|x|torque", [STILL, WANDERS, WANDERS], (None, None, [])),
        # one that moves without steps gives way to one with more than on and off
        ("time|speed|torque|x", [STILL, WANDERS, WANDERS, HOLDS], ("clutch", "x", ["input-by-its-steps"])),
        ("time|speed|torque|x", [STILL, WANDERS, WANDERS, STEP], ("friction-speed", "speed", [])),
        # of several kinds, the one that moves; the duty where none does
        ("time|duty|torque|force|rpm", [STILL, STILL, WANDERS, STEP, SPEED], ("friction-force", "force", [])),
        ("time|duty|torque|force|rpm", [STILL, STILL, WANDERS, STILL, SPEED], ("clutch", "duty", [])),
        ("time|duty|torque|force|rpm", [STILL, STEP, WANDERS, STEP, STEP], ("clutch", "duty", [])),
        ("time|torque|force|rpm", [STILL, WANDERS, SPEED, STEP], ("friction-speed", "rpm", [])),
    ],
)  # fmt: skip
def test_the_input_by_what_moves(names: str, values: list[np.ndarray], expected: object) -> None:
    assert taken(names, values) == expected


def test_two_kinds_of_which_both_or_none_move_are_refused() -> None:
    for values in ([STILL, WANDERS, STEP, STEP], [STILL, WANDERS, SPEED, SPEED]):
        with pytest.raises(DataError, match="may be friction-force and friction-speed, as it has a column of each"):
            taken("time|torque|force|rpm", values)


def test_an_input_that_is_said_is_taken_as_it_is() -> None:
    columns = ReadOptions(columns={"input": "force"})
    assert taken("time|torque|force|rpm|x", [STILL, WANDERS, STILL, STEP, STEP], columns)[:2] == (
        "friction-force",
        "force",
    )
    # level and instant are said elsewhere: no column is looked for by its steps
    assert taken("time|x|torque", [STILL, STEP, WANDERS], known=True) == (None, None, [])


@pytest.mark.parametrize(("rise", "moves"), [(0.19, False), (0.21, False), (0.26, True)])
def test_an_input_moves_by_more_than_a_fifth_of_its_largest(rise: float, moves: bool) -> None:
    """From 1 to 1.21 is 0.17 of 1.21, to 1.26 is 0.206 of it."""
    values = [STILL, WANDERS, 1 + rise * STEP, STILL]
    if moves:
        assert taken("time|torque|force|rpm", values) == ("friction-force", "force", [])
    else:
        with pytest.raises(DataError, match="may be friction-force and friction-speed"):
            taken("time|torque|force|rpm", values)


T = np.arange(60.0)


@pytest.mark.parametrize(
    ("values", "rate", "expected"),
    [
        ([T, STEP, WANDERS], None, (0, 1, 2, "time, input, output")),
        ([T, WANDERS], None, (0, None, 1, "time, output")),
        ([STEP, WANDERS], 5.0, (None, 0, 1, "input, output")),
        ([WANDERS], 5.0, (None, None, 0, "output")),
        ([T, T, WANDERS], None, (0, 1, 2, "time, input, output")),  # the first of two that rise
        ([WANDERS] * 3, None, (0, 1, 2, "time, input, output")),  # bad rows are told when they are read
    ],
)
def test_columns_without_names_by_their_place(values: list[np.ndarray], rate: float | None, expected: object) -> None:
    table = Table("", ("",) * len(values), lambda wanted: Cells(tuple(values[i] for i in wanted)), rate_hz=rate)
    found = by_place("log", table, ReadOptions())
    ((kind, at),) = found.inputs or (("clutch", None),)
    assert kind == "clutch"
    assert (found.time, at, found.output, found.findings[0].values["order"]) == expected
    plain = Table("", table.columns, table.load)
    assert by_place("log", plain, ReadOptions(rate_hz=5.0) if rate else ReadOptions()).output == found.output
    if at is not None:
        assert by_place("log", table, ReadOptions(kind="friction-speed")).inputs == (("friction-speed", at),)


@pytest.mark.parametrize(
    ("values", "proposed"),
    [
        ([STEP, T, WANDERS], "; only column 2 rises all the way; * time=2,input=1,output=3;"),
        ([WANDERS, STEP, T], "; only column 3 rises all the way; * time=3,input=2,output=1;"),
        ([T, WANDERS, WANDERS, STEP], "; only column 1 rises all the way; * time=1,input=4,output=3;"),
        ([STEP, WANDERS, WANDERS, T], "; only column 4 rises all the way; * time=4,input=1,output=3;"),
        ([T, STEP, WANDERS, WANDERS, WANDERS], "; only column 1 rises all the way; * time=1,input=2,output=5;"),
        ([WANDERS, WANDERS, STEP, T], "; only column 4 rises all the way; * time=4,input=3,output=2;"),
        ([WANDERS, STEP, STEP, T], "; only column 4 rises all the way; * time=4,input=2,output=3;"),
        ([T, T, STEP, WANDERS], "; * time=1,input=3,output=4"),
        ([WANDERS, WANDERS, STEP, STEP], "; * time=1,input=3,output=4"),
        ([T, WANDERS, WANDERS, WANDERS], "; only column 1 rises all the way; * time=1,output=4;"),
        ([WANDERS, T], "; only column 2 rises all the way; * time=2,output=1;"),
        ([T], "; only column 1 rises all the way; * time=1,output=1;"),
    ],
)  # fmt: skip
def test_what_is_proposed_where_the_places_say_nothing(values: list[np.ndarray], proposed: str) -> None:
    table = Table("", ("",) * len(values), lambda wanted: Cells(tuple(values[i] for i in wanted)))
    with pytest.raises(DataError) as fault:
        by_place("log", table, ReadOptions())
    count = len(values)
    wanted = proposed.replace("*", f"say by number, from 1 to {count}, what they are: «columns»")
    ending = " and the unit of time if it is not s, perhaps «units» time=ms" if wanted.endswith(";") else ""
    assert fault.value.sentences == (f"log: its {count} columns have no names{wanted}{ending}",)


@pytest.mark.parametrize(("apart", "unit"), [(0.99, ""), (1.0, "ms"), (500.0, "ms"), (1000.0, "us"), (1e6, "ns")])
def test_the_unit_that_is_proposed_for_a_time_without_a_name(apart: float, unit: str) -> None:
    values = [apart * T, STEP, WANDERS, WANDERS]
    table = Table("", ("",) * 4, lambda wanted: Cells(tuple(values[i] for i in wanted)))
    with pytest.raises(DataError) as fault:
        by_place("log", table, ReadOptions())
    assert fault.value.sentences[0].endswith(f"perhaps «units» time={unit}" if unit else "time=1,input=2,output=4")
