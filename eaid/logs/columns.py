"""Which column is the time, the input and the output: by name, in the usual spellings, or as the user says."""

import contextlib
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import median
from eaid.errors import DataError, UsageError, meant
from eaid.findings import Finding, finding
from eaid.logs.table import LogTable
from eaid.logs.units import LINEAR_SPEED, split_name, unit_of, words_of
from eaid.options import ExperimentKind, ReadOptions
from eaid.shown import listed


class Group(NamedTuple):
    """Names of columns that mean the same, and their unit where nothing says it (empty: unknown)."""

    unit: str
    names: tuple[str, ...]


TIME_NAMES = (
    Group("s", ("time", "t", "zeit", "tijd", "temps", "tiempo", "tempo", "elapsed", "elapsedtime", "xvalue")),
    Group("s", ("timestamp", "seconds", "sec", "secs", "s", "ms", "us", "millis", "micros", "minutes", "hours", "days",
                "clock", "datetime", "posixtime", "unixtime", "epoch")),
)  # fmt: skip
INPUT_GROUPS: dict[ExperimentKind, tuple[Group, ...]] = {
    "clutch": (
        Group("%", ("duty", "dutycycle", "pwm", "throttle", "tastgrad")),
        Group("", ("control", "controlsignal", "command", "cmd", "input", "u")),
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
OUTPUTS = (
    Group("", ("torque", "clutchtorque", "moment", "drehmoment", "koppel", "couple", "trq")),
    Group("N", ("shearforce", "frictionforce", "friction", "tangentialforce")),
    Group("N", ("loadcell", "force", "load", "kraft", "kracht", "fuerza")),
    Group("", ("output", "response", "sensor", "measured", "y")),
)
# Words in the names of columns that hold a setting, not what was measured or commanded
SETTINGS = {"limit", "limits", "max", "maximum", "min", "minimum", "offset", "bias", "gain", "threshold", "range",
            "zero", "tare", "rated", "nominal"}  # fmt: skip
# Words in the names of columns that say where something is or how fast it goes: no input by elimination
MOTION = {"position", "pos", "encoder", "enc", "angle", "displacement", "distance", "travel", "velocity", "vel",
          "speed", "moving", "velocidad", "geschwindigkeit", "vitesse", "posicion", "weg", "v", "x"}  # fmt: skip
# Words in the names of columns that switch something on
SWITCHES = {"relay", "trigger", "trig", "gate", "enable", "enabled", "switch", "valve", "cmd", "command", "drive",
            "on", "supply", "hv"}  # fmt: skip
FEWEST_IN_COLUMN = 20  # Samples below which a column is too short to step
_REFERENCE = {"reference", "ref", "desired", "des", "target", "setpoint", "command", "cmd", "commanded", "sp", "soll",
              "sollwert", "sollmoment", "sollkraft", "consigne", "consigna"}  # fmt: skip


@dataclass(frozen=True)
class Roles:
    """Column numbers of one table, from 0."""

    time: int | None
    # What may be the input by its name, most likely first; the data decide where there are several
    inputs: tuple[tuple[ExperimentKind, int], ...]
    output: int
    reference: int | None
    position: int | None = None  # A displacement that goes to and fro, where the user names one
    findings: tuple[Finding, ...] = ()

    @property
    def taken(self) -> set[int | None]:
        """The columns that are something."""
        return {self.time, self.output, self.reference, self.position, *(column for _, column in self.inputs)}


def _bare(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", split_name(name)[0].lower())


def _alike(names: Sequence[str], spellings: Iterable[str], taken: set[int]) -> list[int]:
    """Columns that carry one of the spellings: as their whole name, else as one of their words."""
    wanted = set(spellings)
    exact = [i for i, name in enumerate(names) if i not in taken and _bare(name) in wanted]
    if exact:
        return exact
    long = {spelling for spelling in wanted if len(spelling) > 2}
    words = {i: words_of(split_name(name)[0]) for i, name in enumerate(names) if i not in taken}
    return [i for i, some in words.items() if some & long and not some & SETTINGS]


def _quantity_of(table: LogTable, column: int) -> str:
    """The quantity of a column by the unit that its file or its name says."""
    return unit_of(table.unit(column)).quantity or unit_of(split_name(table.columns[column])[1]).quantity


def as_list(names: Sequence[str]) -> str:
    """Columns as a sentence lists them."""
    return listed([name or f"column {i + 1}" for i, name in enumerate(names)], 12)


def _dropped(table: LogTable) -> str:
    return f"; without numbers: {listed(table.dropped, 6)}" if table.dropped else ""


def _named_column(table: LogTable, role: str, given: str) -> int:
    """Column that the user names: exactly, then whatever the case, then without its unit, then by its number.

    `u[2]` is the second column of the matrix u.
    """
    names, low = table.columns, given.lower()
    without_units = [split_name(name)[0].lower() for name in names]
    for spelled, wanted in ((names, given), ([name.lower() for name in names], low), (without_units, low)):
        if spelled.count(wanted) == 1:
            return spelled.index(wanted)
    place = re.fullmatch(r"(?:(.+)\[)?(\d+)\]?", given)
    if place and place[1] in (None, table.name) and 1 <= int(place[2]) <= len(names):
        return int(place[2]) - 1
    raise table.fault(
        f"has no column {given} for «columns» {role}={given}; its columns are {as_list(names)} "
        f"(a number counts them from 1){meant(given, names)}"
    )


def _only(table: LogTable, role: str, hits: Sequence[int]) -> int | None:
    """The only column there is; None where there is none; raises DataError where there are several."""
    names = table.columns
    if len(hits) > 1:
        first = names[hits[0]] if names.count(names[hits[0]]) == 1 else ""
        raise table.fault(
            f"several columns may be the {role} ({as_list([names[i] for i in hits])}); "
            f'say which with «columns» {role}="{first or hits[0] + 1}"'
        )
    return hits[0] if hits else None


def match_columns(table: LogTable, options: ReadOptions) -> Roles:
    """Roles of a table's columns; raises DataError where the output, or the time, cannot be told."""
    names = table.columns
    named = {role: _named_column(table, role, name) for role, name in options.columns.items()}
    for role, other in ((a, b) for a in named for b in named if a < b and named[a] == named[b]):
        raise UsageError(f"«columns»: {role} and {other} are the same column, {table.label(named[role])}")
    time = named["time"] if "time" in named else _time(table, set(named.values()))
    if time is None and options.rate_hz is None:
        raise table.fault(
            f"no column is called time (columns: {as_list(names)}{_dropped(table)}); name it with «columns» "
            f"time=NAME, or give «rate_hz» HZ where the log has none"
        )
    taken = {*named.values(), *([time] if time is not None else [])}
    references = [i for i, name in enumerate(names) if i not in taken and words_of(split_name(name)[0]) & _REFERENCE]
    torque = set(OUTPUTS[0].names)
    of_torque = [i for i in references if words_of(split_name(names[i])[0]) & torque or _bare(names[i])[:3] == "ref"]
    reference = named.get("reference", of_torque[0] if len(of_torque) == 1 else None)
    taken |= set(of_torque)
    output = named["output"] if "output" in named else _output_column(table, taken, references)

    taken |= {output}
    quantity = [unit_of(split_name(name)[1]).quantity for name in names]
    alike = [i for i in references if i not in taken and quantity[i] and quantity[i] == quantity[output]]
    if "input" in named:
        of_input = experiment_of_input(names[named["input"]], options.units.get("input", ""))
        unit = options.units.get("output", "") or split_name(names[output])[1]
        kind = options.kind or (of_input if slips(names[output], unit) else "clutch")
        inputs = [(kind, named["input"])]
    else:
        inputs = _inputs(table, taken | set(alike), options.kind)
        driven = not {"reference", "position"} & named.keys() and quantity[output] in ("duty", "voltage", "current")
        if not inputs and driven:  # a sensor's volts beside those of a command
            inputs = _inputs(table, taken, options.kind)
            alike = [i for i in alike if i not in {column for _, column in inputs}]
    if reference is None and len(alike) == 1:  # a reference in the output's own unit: no input
        reference = alike[0]
    return Roles(time, tuple(inputs), output, reference, named.get("position"))


def _inputs(table: LogTable, taken: set[int], wanted: ExperimentKind | None) -> list[tuple[ExperimentKind, int]]:
    """What may be the input of each kind of experiment, or of the one that is wanted; at most one a kind."""
    inputs: list[tuple[ExperimentKind, int]] = []
    for kind, groups in INPUT_GROUPS.items():
        which = next((hit for group in groups if (hit := _measuring(table, group, taken))), [])
        if wanted in (None, kind) and (column := _only(table, "input", which)) is not None:
            inputs.append((kind, column))
    return inputs


def _measuring(table: LogTable, group: Group, taken: set[int]) -> list[int]:
    """Columns of a group by their names whose unit is not that of something else; v may be a voltage or a velocity."""
    hits = []
    for i in _alike(table.columns, group.names, taken):
        unit = table.unit(i) or split_name(table.columns[i])[1]
        same = unit_of(unit).quantity in ("", "duty", "voltage", "current", unit_of(group.unit).quantity)
        if (same or not group.unit) and not LINEAR_SPEED.match(unit) and (table.columns[i].strip() != "v" or unit):
            hits.append(i)
    return hits


def _time(table: LogTable, taken: set[int]) -> int | None:
    """The time column: by its format, by its name, else the only one in a unit of time; None where there is none."""
    if table.clock is not None:
        return table.clock
    names = table.columns
    for group in TIME_NAMES:
        clocks = _alike(names, group.names, taken)
        if len(clocks) > 1:
            units = {i: split_name(names[i])[1] for i in clocks}  # `T [degC]` is a temperature
            clocks = [i for i in clocks if not units[i] or unit_of(units[i]).quantity == "time"]
            if all(_quantity_of(table, i) == "time" for i in clocks):
                clocks = sorted(clocks, key=lambda i: i in table.stamped)[:1]  # they are compared when they are read
        if (time := _only(table, "time", clocks)) is not None:
            return time
    timed = [i for i in range(len(names)) if i not in taken and _quantity_of(table, i) == "time"]
    return timed[0] if len(timed) == 1 else None


def _output_column(table: LogTable, taken: set[int], references: Sequence[int]) -> int:
    """The output column: by its name, else the only one in a unit of torque; raises DataError where there is none."""
    names = table.columns
    for spelled in (names, [split_name(name)[0].rstrip("0123456789") for name in names]):  # torque1, torque2
        for group in OUTPUTS:
            if (output := _only(table, "output", _alike(spelled, group.names, taken))) is not None:
                return output
    free = [i for i in range(len(names)) if i not in taken]
    turned = [i for i in free if i not in references and _quantity_of(table, i) == "torque"]
    if (output := _only(table, "output", turned)) is not None:
        return output
    raise table.fault(
        f"no column is called torque, force … (columns: {as_list(names)}{_dropped(table)}); name what "
        f"was measured with «columns» output=NAME"
    )


def columns_guessed(table: LogTable, options: ReadOptions) -> dict[str, str]:
    """Columns that may be what no name says: the one that rises, the one that steps, the one that does neither."""
    names, known = table.columns, dict[str, int | None]()
    for role, name in options.columns.items():
        known[role] = _named_column(table, role, name)
    if "time" not in known and (clock := _time(table, set())) is not None:
        known["time"] = clock
    with contextlib.suppress(DataError):
        known.setdefault("output", _output_column(table, set(), ()))
    free = [i for i in range(min(len(names), 64)) if i not in (*known.values(), *table.stamped)]
    numbers: dict[int, NDArray[Any]] = {}
    for i in free:
        with contextlib.suppress(DataError):  # a column of words
            (values,) = table.load([i]).values
            if len(kept := values[np.isfinite(values)]) > len(values) / 2 and np.ptp(kept) > 0:
                numbers[i] = kept
    found = {"time": table.stamped[0]} if table.stamped and not any(names) else {}
    rising = [i for i in numbers if rises(numbers[i])]
    if "time" not in known and rising:
        found["time"] = min(rising, key=lambda i: bool((np.diff(numbers[i]) == 1).all()))  # what counts rows last
    # neither: beside a known time, what counts rows; another time; what has the name of an input or a reference
    out = {i for i in rising if "time" in found or np.ptp(np.diff(numbers[i])) == 0}
    out |= {i for i in numbers if _quantity_of(table, i) == "time"}
    out |= {i for i in numbers if words_of(split_name(names[i])[0]) & _REFERENCE}
    out |= {i for group in INPUT_GROUPS["clutch"] for i in _alike(names, group.names, set())}
    moved = {i for i in numbers if words_of(split_name(names[i])[0]) & MOTION or _quantity_of(table, i) == "speed"}
    stepping: dict[bytes, list[int]] = {}  # When → the columns that step then
    for i in numbers:
        if i not in out | moved and moves_in_steps(numbers[i]):
            stepping.setdefault(np.flatnonzero(np.diff(numbers[i])).tobytes(), []).append(i)
    few = sorted(stepping, key=len)
    if "input" not in known and few and (len(few) == 1 or 3 * len(few[0]) < len(few[1])):
        found["input"] = max(stepping[few[0]], key=lambda i: bool(_quantity_of(table, i)))  # one with a unit first
        out |= {*stepping[few[0]]}
    span = sorted((float(np.ptp(values)), i) for i, values in numbers.items() if i not in out)
    clear = len(span) == 1 or (len(span) > 1 and "input" in known | found and span[-1][0] > 2 * span[-2][0])
    if "output" not in known and clear:
        found["output"] = span[-1][1]
    return {role: names[i] or str(i + 1) for role, i in found.items()}


def slips(name: str, unit: str) -> bool:
    """Whether an output can be that of a friction rig: a torque or force by its unit or name, or nothing says what."""
    quantity = unit_of(unit).quantity
    named = any(_alike([name], group.names, set()) for group in OUTPUTS)
    return quantity in ("torque", "force") or (not quantity and (named or not re.search("[A-Za-z]", name)))


def experiment_of_input(name: str, unit: str) -> ExperimentKind:
    """Experiment that a user's own choice of input column means."""
    for kind, groups in INPUT_GROUPS.items():
        if any(_alike([name], group.names, set()) for group in groups):
            return kind
    quantity = unit_of(unit or split_name(name)[1]).quantity
    if quantity == "speed":
        return "friction-speed"
    return "friction-force" if quantity in ("force", "pressure") else "clutch"


def default_unit(column: str, kind: ExperimentKind | None = None) -> str:
    """Unit of an output, or of the input of an experiment, whose name carries none; empty where its name does not say
    the quantity."""
    groups = OUTPUTS if kind is None else INPUT_GROUPS[kind]
    return next((group.unit for group in groups if _alike([column], group.names, set())), "")


def chosen_table(tables: Sequence[LogTable], options: ReadOptions) -> tuple[LogTable, Roles]:
    """The one table that is a log: the one named, else the only one whose columns match."""
    wanted = [table for table in tables if options.variable in (None, table.name)]
    if not wanted:
        names = ", ".join(table.name or "(no name)" for table in tables[:12])
        raise tables[0].fault(f"holds no table {options.variable} for «variable»; it holds {names}")
    good: list[tuple[LogTable, Roles]] = []
    faults: list[DataError] = []
    for table in wanted[: 1 if options.variable is not None else None]:
        match = match_columns if any(table.columns) or "output" in options.columns else by_place
        try:
            good.append((table, match(table, options)))
        except DataError as fault:
            faults.append(fault)
    if not good:
        if len(faults) == 1:
            raise faults[0]
        held = [f"{one.name or 'table'}: {', '.join(c or '?' for c in one.columns[:8])}" for one in tables[:6]]
        raise tables[0].fault(
            f"no table in it has columns of time and output ({'; '.join(held)}); choose with «variable» and «columns»"
        )
    full = [pair for pair in good if pair[1].inputs]
    if not full and {options.variable, options.name_pattern} == {None} and "input" not in options.columns:
        words = {word for group in INPUT_GROUPS["clutch"] for word in group.names}
        beside = [name for table in tables if all(table is not one for one, _ in good) for name in table.columns]
        if called := [beside[i] for i in _alike(beside, words, set())]:
            raise tables[0].fault(
                f"{as_list(called)} stands in another table, or is of another length, than the output; save "
                f"them on one clock, or say the level with «name_pattern»"
            )
    full = full or good
    if len(full) > 1:
        names = ", ".join(table.name for table, _ in full[:12])
        raise tables[0].fault(f"holds several tables that may be the log ({names}); choose one with «variable» NAME")
    return full[0]


def by_place(table: LogTable, options: ReadOptions) -> Roles:
    """Columns without names: of two time, output, the first rising all the way; with a rate input, output.

    A matrix of three is time, input, output, as QuaRC writes it; a text of three is asked about as one of four.
    """
    count, rate = len(table.columns), options.rate_hz is not None
    places = {(2, False): (0, None, 1), (2, True): (None, 0, 1), (1, True): (None, None, 0)}
    if table.name:  # a matrix of a MAT-file
        places[3, False] = (0, 1, 2)
    if not options.columns and (count, rate) in places and (rate or rises(table.load([0]).values[0])):
        time, input_, output = places[count, rate]
        roles = (("time", time), ("input", input_), ("output", output))
        inputs = () if input_ is None else ((options.kind or "clutch", input_),)
        order = ", ".join(role for role, at in roles if at is not None)
        return Roles(time, inputs, output, None, findings=(finding("columns-by-place", table.source, order=order),))
    names = f"columns have {len(table.unmatched)} names, {listed(table.unmatched, 5)}, of which none is taken"
    guessed = {} if options.columns else columns_guessed(table, options)
    if "output" not in guessed:
        guessed = {"time": "1", "input": "2", "output": "3"} if count > 2 else {"time": "1", "output": "2"}
    known = ",".join(f"{role}={column}" for role, column in guessed.items())
    of_time = "«units» time=UNIT where it is not in s" if "time" in guessed else "«rate_hz» HZ where none is the time"
    raise table.fault(
        f"its {count} {names if table.unmatched else 'columns have no names'}; say by number, from 1 to "
        f"{count}, what they are, as in «columns» {known}, and {of_time}"
    )


def rises(values: NDArray[Any]) -> bool:
    """Whether a column rises all the way but for 1 % of its rows, as a time does."""
    kept = values[np.isfinite(values)]
    return len(kept) > 2 and bool(np.mean(np.diff(kept) > 0) > 0.99)


def leaves_rest(values: NDArray[Any]) -> int | None:
    """First row on which a column is beyond what its first fiftieth did; None of one that stands still, or is noise."""
    head = values[: max(FEWEST_IN_COLUMN, len(values) // 50)]
    if len(values) <= FEWEST_IN_COLUMN or not np.isfinite(values).all():
        return None
    away = np.abs(values - median(head))
    beyond = max(1.5 * float(np.ptp(head)), 0.01 * float(away.max()))
    return int((away > beyond).argmax()) if 0 < 2 * beyond < away.max() else None


def moves_in_steps(values: NDArray[Any]) -> bool:
    """Whether a column stands still but for a few jumps, each from one sample to the next, as a commanded input."""
    kept = values[np.isfinite(values)].astype(np.float64)
    span = float(np.ptp(kept)) if len(kept) >= FEWEST_IN_COLUMN else 0.0
    if span == 0.0:
        return False
    moves = np.abs(np.diff(kept)) > 0.01 * span
    alone = moves.copy()
    alone[1:] &= ~moves[:-1]
    alone[:-1] &= ~moves[1:]
    return 1 <= int(moves.sum()) <= max(3, len(kept) // 20) and int(alone.sum()) >= 0.8 * int(moves.sum())
