"""Which column is the time, the input and the output: by name, in the usual spellings, or as the user says."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eaid.errors import DataError, UsageError
from eaid.findings import Finding, finding
from eaid.logs.options import ReadOptions
from eaid.logs.run import Kind
from eaid.logs.table import Table
from eaid.logs.units import likely_time_unit, split_name, unit_of, words_of

FEWEST = 20
"""Samples below which a column is not said to step."""
ROLES = ("time", "input", "output", "reference")

TIME: tuple[tuple[str, ...], ...] = (
    ("time", "t", "zeit", "tijd", "temps", "tiempo", "tempo", "elapsed", "elapsedtime", "xvalue"),
    ("timestamp", "seconds", "sec", "secs", "s", "ms", "us", "millis", "micros", "minutes", "hours", "days", "clock",
     "datetime", "posixtime", "unixtime", "epoch"),
)  # fmt: skip
INPUTS: dict[Kind, tuple[tuple[str, ...], ...]] = {
    "clutch": (
        ("duty", "dutycycle", "pwm", "tastgrad"),
        ("control", "controlsignal", "command", "cmd", "input", "u"),
        ("voltage", "volts", "volt", "spannung", "v"),
        ("current", "strom", "stroom", "courant", "corriente", "ampere", "amps"),
    ),
    "friction-force": (
        ("normalforce", "force", "load", "weight", "normalload", "fn", "kraft", "kracht", "fuerza"),
        ("pressure", "normalpressure", "stress", "druck"),
    ),
    "friction-speed": (("speed", "rpm", "rotationspeed", "velocity", "angularvelocity", "omega", "drehzahl"),),
}
INPUT_UNITS: dict[Kind, tuple[str, ...]] = {
    "clutch": ("%", "%", "V", ""),
    "friction-force": ("N", "bar"),
    "friction-speed": ("RPM",),
}
"""Unit of each group of inputs where nothing says it."""
TRIGGERS = ("trigger", "trig", "enable", "enabled", "gate", "relay", "onoff", "active")
"""Columns that only say when the input is on; its level comes from the file name."""
OUTPUTS: tuple[tuple[str, ...], ...] = (
    ("torque", "clutchtorque", "moment", "drehmoment", "koppel", "couple", "trq"),
    ("shearforce", "frictionforce", "friction", "tangentialforce"),
    ("loadcell", "force", "load", "kraft", "kracht", "fuerza"),
    ("output", "response", "sensor", "measured", "y"),
)
OUTPUT_UNITS = ("", "N", "N", "")
"""Unit of each group of outputs where nothing says it; a torque's is unknown."""
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


def shown(names: Sequence[str]) -> str:
    """Columns as a sentence lists them."""
    listed = ", ".join(name if name else f"column {i + 1}" for i, name in enumerate(names[:12]))
    return listed + (f" and {len(names) - 12} more" if len(names) > 12 else "")


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
        f"(a number counts them from 1)"
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
    if not any(names) and "output" not in said:
        return _by_place(path, table, options, said, bool(rate))
    taken = set(said.values())
    time = said.get("time")
    for group in TIME:
        if time is None:
            time = table.clock if table.clock is not None else _only(path, "time", _alike(names, group, taken), names)
    if time is None and not rate:
        raise DataError(
            f"{path}: no column is called time (columns: {shown(names)}); name it with «columns» time=NAME, "
            f"or give «rate» HZ where the log has none"
        )
    taken |= {time} if time is not None else set()
    references = [i for i, name in enumerate(names) if i not in taken and words_of(split_name(name)[0]) & _REFERENCE]
    torques = [
        i for i in references if words_of(split_name(names[i])[0]) & set(OUTPUTS[0]) or _bare(names[i])[:3] == "ref"
    ]
    reference = said.get("reference", torques[0] if len(torques) == 1 else None)
    shut = taken | set(torques)

    output = said.get("output")
    for group in OUTPUTS:
        if output is None:
            output = _only(path, "output", _alike(names, group, shut), names)
    if output is None:
        raise DataError(
            f"{path}: no column is called torque (columns: {shown(names)}); name what was measured with "
            f"«columns» output=NAME"
        )
    shut = shut | {output}
    if "input" in said:
        kind = options.kind or kind_of(names[said["input"]], options.units.get("input", ""))
        inputs = [(kind, said["input"])]
    else:
        inputs = _inputs(path, names, shut, options.kind)
    roled = {*shut, *(column for _, column in inputs)} | ({reference} if reference is not None else set())
    triggers = [] if inputs else _alike(names, TRIGGERS, roled)
    others = tuple(i for i in range(len(names)) if i not in roled)
    trigger = triggers[0] if len(triggers) == 1 else None
    return Roles(time, tuple(inputs), output, reference, "input" in said, trigger, others)


def _inputs(path: str, names: Sequence[str], shut: set[int], kind: Kind | None) -> list[tuple[Kind, int]]:
    """Columns that are called like an input, at most one a kind."""
    found: list[tuple[Kind, int]] = []
    for one, groups in INPUTS.items():
        if kind in (None, one):
            which = next((hit for group in groups if (hit := _alike(names, group, shut))), [])
            column = _only(path, "input", which, names)
            if column is not None:
                found.append((one, column))
    return found


def kind_of(name: str, unit: str) -> Kind:
    """Experiment that a user's own choice of input column means."""
    for kind, groups in INPUTS.items():
        if any(_alike([name], group, set()) for group in groups):
            return kind
    unit = unit or split_name(name)[1]
    known = unit_of(unit) if unit else None
    kinds: dict[str, Kind] = {"force": "friction-force", "pressure": "friction-force", "speed": "friction-speed"}
    return kinds.get(known.quantity if known else "", "clutch")


def output_default(column: str) -> str:
    """Unit of an output column that names none."""
    pairs = zip(OUTPUTS, OUTPUT_UNITS, strict=True)
    return next((unit for group, unit in pairs if _alike([column], group, set())), "")


def input_default(kind: Kind, column: str) -> str:
    """Unit of an input column that names none; empty where its name does not say the quantity."""
    pairs = zip(INPUTS[kind], INPUT_UNITS[kind], strict=True)
    return next((unit for group, unit in pairs if _alike([column], group, set())), "")


def _by_place(path: str, table: Table, options: ReadOptions, said: Mapping[str, int], rate: bool) -> Roles:
    """Columns without names: time, input, output where there are three; time, output where there are two.

    The first has to be the only one that rises all the way; where another one does, it is proposed.
    """
    count = len(table.columns)
    places = {(3, False): (0, 1, 2), (2, False): (0, None, 1), (2, True): (None, 0, 1), (1, True): (None, None, 0)}
    columns: tuple[NDArray[Any], ...] = ()
    rising, stepping = (), ()
    if count <= 64:
        columns = table.load(range(count)).values
        rising = tuple(i + 1 for i, values in enumerate(columns) if rises(values))
        stepping = tuple(i + 1 for i, values in enumerate(columns) if steps(values))
    if said or (count, rate) not in places or (not rate and rising and 1 not in rising):
        time = rising[0] if len(rising) == 1 else 1
        input_ = next((i for i in stepping if i != time), None)
        output = next((i for i in range(count, 0, -1) if i not in (time, input_)), count)
        proposed = ",".join(f"{role}={i}" for role, i in (("time", time), ("input", input_), ("output", output)) if i)
        only = f"; only column {time} rises all the way" if len(rising) == 1 else ""
        usual = float(np.median(np.diff(columns[time - 1]))) if only else 0.0
        units = (
            f"; and the unit of time if it is not s, perhaps «units» time={likely_time_unit(usual)}"
            if usual >= 1
            else ""
        )
        raise DataError(
            f"{path}: its {count} columns have no names{only}; say by number, from 1 to {count}, what they are: "
            f"«columns» {proposed}{units}"
        )
    time_at, input_at, output_at = places[count, rate]
    order = [name for name, at in (("time", time_at), ("input", input_at), ("output", output_at)) if at is not None]
    inputs = ((options.kind or "clutch", input_at),) if input_at is not None else ()
    told = finding("columns-by-place", path, order=", ".join(order))
    return Roles(time_at, inputs, output_at, None, findings=(told,))


def rises(values: NDArray[Any]) -> bool:
    """Whether a column rises all the way but for 1 % of its rows, as a time does."""
    kept = values[np.isfinite(values)]
    return len(kept) > 2 and bool(np.mean(np.diff(kept) > 0) > 0.99)


def steps(values: NDArray[Any]) -> bool:
    """Whether a column stands still but for a few jumps, each from one sample to the next, as a commanded input."""
    kept = values[np.isfinite(values)].astype(np.float64)
    span = float(np.ptp(kept)) if len(kept) >= FEWEST else 0.0
    if span == 0.0:
        return False
    jumps = np.abs(np.diff(kept)) > 0.01 * span
    alone = jumps.copy()
    alone[1:] &= ~jumps[:-1]
    alone[:-1] &= ~jumps[1:]
    return 1 <= int(jumps.sum()) <= max(3, len(kept) // 20) and int(alone.sum()) >= 0.8 * int(jumps.sum())


def the_input(
    path: str, table: Table, roles: Roles, column: Callable[[int], NDArray[Any]], told: bool
) -> tuple[Kind | None, int | None, tuple[Finding, ...]]:
    """The input among the columns that may be it: the one that moves, where the names leave a choice.

    Where none that is called like an input moves, the only other column that steps is taken, and said; not where
    options say level and instant (`told`).
    """
    if roles.said or (len(roles.inputs) == 1 and not roles.others):
        return (*roles.inputs[0], ())
    moving = [(kind, which) for kind, which in roles.inputs if _moves(column(which))]
    if len(moving) == 1:
        return (*moving[0], ())
    if not moving and not told:
        stepping = [which for which in roles.others[:64] if steps(column(which))]
        if len(stepping) == 1:
            name = table.label(stepping[0])
            still = shown([table.label(which) for _, which in roles.inputs])
            code = "input-by-its-steps" if still else "input-unnamed"
            return kind_of(name, ""), stepping[0], (finding(code, path, column=name, still=still),)
    if len(roles.inputs) <= 1 or roles.inputs[0][0] == "clutch":  # a duty beside the constant speed and force
        return (*roles.inputs[0], ()) if roles.inputs else (None, None, ())
    kinds = " and ".join(kind for kind, _ in roles.inputs)
    raise DataError(f"{path}: may be {kinds}, as it has a column of each; say which with «kind»")


def _moves(values: NDArray[Any]) -> bool:
    kept = values[np.isfinite(values)]
    low, high = (float(kept.min()), float(kept.max())) if len(kept) else (0.0, 0.0)
    return high - low > 0.2 * max(abs(low), abs(high))
