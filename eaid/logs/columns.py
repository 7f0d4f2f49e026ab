"""Which column is the time, the input and the output: by name, in the usual spellings, or as the user says."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from eaid.errors import DataError, UsageError, meant
from eaid.findings import Finding
from eaid.logs.run import Kind
from eaid.logs.table import Table
from eaid.logs.units import split_name, unit_of, words_of
from eaid.options import ReadOptions
from eaid.shown import listed


class Group(NamedTuple):
    """Names of columns that mean the same, and their unit where nothing says it (empty: unknown)."""

    unit: str
    names: tuple[str, ...]


TIME = (
    Group("s", ("time", "t", "zeit", "tijd", "temps", "tiempo", "tempo", "elapsed", "elapsedtime", "xvalue")),
    Group("s", ("timestamp", "seconds", "sec", "secs", "s", "ms", "us", "millis", "micros", "minutes", "hours", "days",
                "clock", "datetime", "posixtime", "unixtime", "epoch")),
)  # fmt: skip
INPUTS: dict[Kind, tuple[Group, ...]] = {
    "clutch": (
        Group("%", ("duty", "dutycycle", "pwm", "throttle", "tastgrad")),
        Group("%", ("control", "controlsignal", "command", "cmd", "input", "u")),
        Group("V", ("voltage", "volts", "volt", "spannung", "v")),
        Group("", ("current", "strom", "stroom", "courant", "corriente", "ampere", "amps")),
    ),
    "friction-force": (
        Group("N", ("normalforce", "force", "load", "weight", "normalload", "fn", "kraft", "kracht", "fuerza")),
        Group("bar", ("pressure", "normalpressure", "stress", "druck")),
    ),
    "friction-speed": (
        Group("RPM", ("speed", "rpm", "rotationspeed", "velocity", "angularvelocity", "omega", "drehzahl")),
    ),
}
TRIGGERS = ("trigger", "trig", "enable", "enabled", "gate", "relay", "onoff", "active")
"""Columns that only say when the input is on; its level comes from the file name."""
OUTPUTS = (
    Group("", ("torque", "clutchtorque", "moment", "drehmoment", "koppel", "couple", "trq")),
    Group("N", ("shearforce", "frictionforce", "friction", "tangentialforce")),
    Group("N", ("loadcell", "force", "load", "kraft", "kracht", "fuerza")),
    Group("", ("output", "response", "sensor", "measured", "y")),
)
COUNTERS = {"sample", "samples", "index", "idx", "count", "counter", "frame", "row", "tick", "ticks", "nr", "no", "n"}
"""Names of columns that number the samples."""
_REFERENCE = {"reference", "ref", "desired", "des", "target", "setpoint", "command", "cmd", "commanded"}


@dataclass(frozen=True)
class Roles:
    """Column numbers of one table, from 0."""

    time: int | None
    inputs: tuple[tuple[Kind, int], ...]
    """What may be the input by its name, most likely first; the data decide where there are several."""
    output: int
    reference: int | None
    said: bool = False
    """Whether the user named the input."""
    trigger: int | None = None
    """A column that says when the input is on, where none says how much."""
    position: int | None = None
    """A displacement that goes to and fro, where the user names one."""
    others: tuple[int, ...] = ()
    """Columns without a role."""
    findings: tuple[Finding, ...] = ()


def _bare(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", split_name(name)[0].lower())


def _alike(names: Sequence[str], spellings: Iterable[str], taken: set[int]) -> list[int]:
    """Columns that carry one of the spellings: as their whole name, else as one of their words."""
    wanted = set(spellings)
    exact = [i for i, name in enumerate(names) if i not in taken and _bare(name) in wanted]
    if exact:
        return exact
    long = {spelling for spelling in wanted if len(spelling) > 2}
    return [i for i, name in enumerate(names) if i not in taken and words_of(split_name(name)[0]) & long]


def _quantity(unit: str) -> str:
    """The quantity that a unit is of; empty where none is known."""
    known = unit_of(unit)
    return known.quantity if known else ""


def _quantity_of(table: Table, column: int) -> str:
    """The quantity of a column by the unit that its file or its name says."""
    return _quantity(table.unit(column)) or _quantity(split_name(table.columns[column])[1])


def _may_be_time(name: str) -> bool:
    """Whether a column's unit does not say that it is something else: `T [degC]` is a temperature."""
    unit = split_name(name)[1]
    return not unit or _quantity(unit) == "time"


def shown(names: Sequence[str]) -> str:
    """Columns as a sentence lists them."""
    return listed([name or f"column {i + 1}" for i, name in enumerate(names)], 12)


def _said_column(path: str, role: str, said: str, table: Table) -> int:
    """Column that the user names: exactly, then whatever the case, then without its unit, then by its number.

    `u[2]` is the second column of the matrix u.
    """
    names = table.columns
    for same in (
        lambda name: name == said,
        lambda name: name.lower() == said.lower(),
        lambda name: split_name(name)[0].lower() == said.lower(),
    ):
        found = [i for i, name in enumerate(names) if same(name)]
        if len(found) == 1:
            return found[0]
    place = re.fullmatch(r"(?:(.+)\[)?(\d+)\]?", said)
    if place and place[1] in (None, table.name) and 1 <= int(place[2]) <= len(names):
        return int(place[2]) - 1
    raise DataError(
        f"{path}: has no column {said} for «columns» {role}={said}; its columns are {shown(names)} "
        f"(a number counts them from 1){meant(said, names)}"
    )


def _only(path: str, role: str, found: Sequence[int], names: Sequence[str]) -> int | None:
    """The one column found; None where there is none; raises DataError where there are several."""
    if len(found) > 1:
        raise DataError(
            f"{path}: several columns may be the {role} ({shown([names[i] for i in found])}); "
            f'say which with «columns» {role}="{names[found[0]] or found[0] + 1}"'
        )
    return found[0] if found else None


def match_columns(path: str, table: Table, options: ReadOptions) -> Roles:
    """Roles of a table's columns; raises DataError where the output, or the time, cannot be told."""
    names = table.columns
    named = _named_by_user(path, table, options)
    time = named["time"] if "time" in named else _time(path, table, set(named.values()))
    if time is None and not (options.rate_hz or table.rate_hz):
        raise DataError(
            f"{path}: no column is called time (columns: {shown(names)}); name it with «columns» time=NAME, "
            f"or give «rate_hz» HZ where the log has none"
        )
    taken = {*named.values(), *([time] if time is not None else [])}
    references = [i for i, name in enumerate(names) if i not in taken and words_of(split_name(name)[0]) & _REFERENCE]
    torque = set(OUTPUTS[0].names)
    of_torque = [i for i in references if words_of(split_name(names[i])[0]) & torque or _bare(names[i])[:3] == "ref"]
    reference = named.get("reference", of_torque[0] if len(of_torque) == 1 else None)
    taken |= set(of_torque)
    output = named["output"] if "output" in named else _output(path, table, taken, references)

    taken |= {output}
    quantity = [_quantity(split_name(name)[1]) for name in names]
    alike = [i for i in references if i not in taken and quantity[i] and quantity[i] == quantity[output]]
    if reference is None and len(alike) == 1:  # asked for in the output's own unit: no input
        reference = alike[0]
    taken |= set(alike)
    if "input" in named:
        kind = options.kind or kind_of(names[named["input"]], options.units.get("input", ""))
        inputs = [(kind, named["input"])]
    else:
        inputs = _inputs(path, names, taken, options.kind)
    taken |= {*(column for _, column in inputs), *([reference] if reference is not None else [])}
    triggers = [] if inputs else _alike(names, TRIGGERS, taken)
    others = tuple(i for i in range(len(names)) if i not in taken)
    trigger = triggers[0] if len(triggers) == 1 else None
    return Roles(time, tuple(inputs), output, reference, "input" in named, trigger, named.get("position"), others)


def _named_by_user(path: str, table: Table, options: ReadOptions) -> dict[str, int]:
    """Role → column, as the user says; raises UsageError where one column has two."""
    named = {role: _said_column(path, role, name, table) for role, name in options.columns.items()}
    for role, other in ((a, b) for a in named for b in named if a < b and named[a] == named[b]):
        raise UsageError(f"«columns»: {role} and {other} are the same column, {table.label(named[role])}")
    return named


def _time(path: str, table: Table, taken: set[int]) -> int | None:
    """The time column: by its format, by its name, else the only one in a unit of time; None where there is none."""
    if table.clock is not None:
        return table.clock
    names = table.columns
    for group in TIME:
        clocks = _alike(names, group.names, taken)
        if len(clocks) > 1:
            clocks = [i for i in clocks if _may_be_time(names[i])]
        if (time := _only(path, "time", clocks, names)) is not None:
            return time
    timed = [i for i in range(len(names)) if i not in taken and _quantity_of(table, i) == "time"]
    return timed[0] if len(timed) == 1 else None


def _output(path: str, table: Table, taken: set[int], references: Sequence[int]) -> int:
    """The output column: by its name, else the only one in a unit of torque; raises DataError where there is none."""
    names = table.columns
    for spelled in (names, [split_name(name)[0].rstrip("0123456789") for name in names]):  # torque1, torque2
        for group in OUTPUTS:
            if (output := _only(path, "output", _alike(spelled, group.names, taken), names)) is not None:
                return output
    free = [i for i in range(len(names)) if i not in taken]
    turned = [i for i in free if i not in references and _quantity_of(table, i) == "torque"]
    if (output := _only(path, "output", turned, names)) is not None:
        return output
    driven = set(_alike(names, {word for group in INPUTS["clutch"] for word in group.names}, taken))
    driven |= {i for i, name in enumerate(names) if split_name(name)[1] in ("%", "V", "A")}
    left = [i for i in free if i not in driven]
    name = f'"{names[left[0]]}"' if len(left) == 1 and names[left[0]] else "NAME"
    raise DataError(
        f"{path}: no column is called torque (columns: {shown(names)}); name what was measured with "
        f"«columns» output={name}"
    )


def _inputs(path: str, names: Sequence[str], taken: set[int], kind: Kind | None) -> list[tuple[Kind, int]]:
    """Columns that are called like an input, at most one a kind."""
    inputs: list[tuple[Kind, int]] = []
    for named_kind, groups in INPUTS.items():
        if kind in (None, named_kind):
            which = next((hit for group in groups if (hit := _alike(names, group.names, taken))), [])
            column = _only(path, "input", which, names)
            if column is not None:
                inputs.append((named_kind, column))
    return inputs


def kind_of(name: str, unit: str) -> Kind:
    """Experiment that a user's own choice of input column means."""
    for kind, groups in INPUTS.items():
        if any(_alike([name], group.names, set()) for group in groups):
            return kind
    kinds: dict[str, Kind] = {"force": "friction-force", "pressure": "friction-force", "speed": "friction-speed"}
    return kinds.get(_quantity(unit or split_name(name)[1]), "clutch")


def default_unit(column: str, groups: Sequence[Group]) -> str:
    """Unit of a column whose name carries none; empty where its name does not say the quantity."""
    return next((group.unit for group in groups if _alike([column], group.names, set())), "")
