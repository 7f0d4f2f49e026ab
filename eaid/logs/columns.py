"""Which column is the time, the input and the output: by name, in the usual spellings, or as the user says."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from eaid.errors import DataError, UsageError, meant
from eaid.findings import Finding
from eaid.logs.options import ReadOptions
from eaid.logs.run import Kind
from eaid.logs.table import Table
from eaid.logs.units import split_name, unit_of, words_of
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


def _quantity(name: str) -> str:
    known = unit_of(split_name(name)[1]) if split_name(name)[1] else None
    return known.quantity if known else ""


def _unit_of(table: Table, column: int) -> str:
    """The quantity of a column by its unit; empty where none is known."""
    known = unit_of(table.unit(column)) if table.unit(column) else None
    return known.quantity if known else _quantity(table.columns[column])


def _may_be_time(name: str) -> bool:
    """Whether a column's unit does not say that it is something else: `T [degC]` is a temperature."""
    return not split_name(name)[1] or _quantity(name) == "time"


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
    said = {role: _said_column(path, role, name, table) for role, name in options.columns.items()}
    for role, other in ((a, b) for a in said for b in said if a < b and said[a] == said[b]):
        raise UsageError(f"«columns»: {role} and {other} are the same column, {table.label(said[role])}")
    rate = options.rate_hz or table.rate_hz
    taken = set(said.values())
    time = said.get("time")
    for group in TIME:
        if time is None:
            clocks = _alike(names, group.names, taken)
            if len(clocks) > 1:
                clocks = [i for i in clocks if _may_be_time(names[i])]
            time = table.clock if table.clock is not None else _only(path, "time", clocks, names)
    if time is None:
        timed = [i for i in range(len(names)) if i not in taken and _unit_of(table, i) == "time"]
        time = timed[0] if len(timed) == 1 else None
    if time is None and not rate:
        raise DataError(
            f"{path}: no column is called time (columns: {shown(names)}); name it with «columns» time=NAME, "
            f"or give «rate_hz» HZ where the log has none"
        )
    taken |= {time} if time is not None else set()
    references = [i for i, name in enumerate(names) if i not in taken and words_of(split_name(name)[0]) & _REFERENCE]
    torque = set(OUTPUTS[0].names)
    torques = [i for i in references if words_of(split_name(names[i])[0]) & torque or _bare(names[i])[:3] == "ref"]
    reference = said.get("reference", torques[0] if len(torques) == 1 else None)
    shut = taken | set(torques)

    output, bare = said.get("output"), [split_name(name)[0] for name in names]
    for spelled in (names, [name.rstrip("0123456789") for name in bare]):  # torque1, torque2
        for group in OUTPUTS:
            if output is None:
                output = _only(path, "output", _alike(spelled, group.names, shut), names)
    if output is None:
        turned = [i for i in range(len(names)) if i not in shut and i not in references]
        output = _only(path, "output", [i for i in turned if _unit_of(table, i) == "torque"], names)
    if output is None:
        driven = set(_alike(names, {word for group in INPUTS["clutch"] for word in group.names}, shut))
        driven |= {i for i, name in enumerate(names) if split_name(name)[1] in ("%", "V", "A")}
        left = [i for i in range(len(names)) if i not in shut and i not in driven]
        name = f'"{names[left[0]]}"' if len(left) == 1 and names[left[0]] else "NAME"
        raise DataError(
            f"{path}: no column is called torque (columns: {shown(names)}); name what was measured with "
            f"«columns» output={name}"
        )
    quantity = _quantity(names[output])
    asked = [i for i in references if i not in shut and i != output and quantity and _quantity(names[i]) == quantity]
    if reference is None and len(asked) == 1:  # asked for in the output's own unit: no input
        reference = asked[0]
    shut = shut | {output, *asked} - {said.get("input")}
    if "input" in said:
        kind = options.kind or kind_of(names[said["input"]], options.units.get("input", ""))
        inputs = [(kind, said["input"])]
    else:
        inputs = _inputs(path, names, shut, options.kind)
    roled = {*shut, *(column for _, column in inputs)} | ({reference} if reference is not None else set())
    triggers = [] if inputs else _alike(names, TRIGGERS, roled)
    others = tuple(i for i in range(len(names)) if i not in roled)
    trigger = triggers[0] if len(triggers) == 1 else None
    return Roles(time, tuple(inputs), output, reference, "input" in said, trigger, said.get("position"), others)


def _inputs(path: str, names: Sequence[str], shut: set[int], kind: Kind | None) -> list[tuple[Kind, int]]:
    """Columns that are called like an input, at most one a kind."""
    found: list[tuple[Kind, int]] = []
    for one, groups in INPUTS.items():
        if kind in (None, one):
            which = next((hit for group in groups if (hit := _alike(names, group.names, shut))), [])
            column = _only(path, "input", which, names)
            if column is not None:
                found.append((one, column))
    return found


def kind_of(name: str, unit: str) -> Kind:
    """Experiment that a user's own choice of input column means."""
    for kind, groups in INPUTS.items():
        if any(_alike([name], group.names, set()) for group in groups):
            return kind
    unit = unit or split_name(name)[1]
    known = unit_of(unit) if unit else None
    kinds: dict[str, Kind] = {"force": "friction-force", "pressure": "friction-force", "speed": "friction-speed"}
    return kinds.get(known.quantity if known else "", "clutch")


def default_unit(column: str, groups: Sequence[Group]) -> str:
    """Unit of a column whose name carries none; empty where its name does not say the quantity."""
    return next((group.unit for group in groups if _alike([column], group.names, set())), "")
