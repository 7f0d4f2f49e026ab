"""Which column is the time, the input and the output: by name, in the usual spellings, or as the user says."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from eaid.errors import DataError, UsageError
from eaid.logs.options import ReadOptions
from eaid.logs.run import INPUT_UNITS, Kind
from eaid.logs.sheet import Sheet
from eaid.logs.units import TIME_UNITS, split_name, unit_of

ROLES = ("time", "input", "output", "reference")

TIME: tuple[tuple[str, ...], ...] = (
    ("time", "t", "zeit", "tijd", "temps", "tiempo", "tempo", "elapsed", "elapsedtime", "xvalue"),
    ("timestamp", "seconds", "sec", "secs", "s", "ms", "clock", "datetime"),
)
INPUTS: dict[Kind, tuple[tuple[str, ...], ...]] = {
    "clutch": (
        ("duty", "dutycycle", "pwm", "tastgrad"),
        ("control", "controlsignal", "command", "cmd", "input", "u"),
        ("voltage", "volts", "volt", "spannung", "v"),
    ),
    "friction-force": (
        ("normalforce", "force", "load", "weight", "normalload", "fn", "kraft", "kracht", "fuerza"),
        ("pressure", "normalpressure", "stress", "druck"),
    ),
    "friction-speed": (("speed", "rpm", "rotationspeed", "velocity", "angularvelocity", "omega", "drehzahl"),),
}
OUTPUTS: tuple[tuple[str, ...], ...] = (
    ("torque", "clutchtorque", "moment", "drehmoment", "koppel", "couple", "trq"),
    ("shearforce", "frictionforce", "friction", "tangentialforce"),
    ("loadcell", "force", "load", "kraft", "kracht", "fuerza"),
    ("output", "response", "sensor", "measured", "y"),
)
OUTPUT_UNITS = ("N·m", "N", "N", "")
_REFERENCE = {"reference", "ref", "desired", "des", "target", "setpoint", "command", "cmd", "commanded"}


@dataclass(frozen=True)
class Roles:
    """Column numbers of one sheet (from 0) and their units."""

    time: int | None
    inputs: tuple[tuple[Kind, int], ...]
    """What may be the input, most likely first; the data decide where there are several."""
    output: int
    reference: int | None
    output_unit: str
    """Unit of the output where neither the file nor the user says one."""
    note: str = ""


def _bare(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", split_name(name)[0].lower())


def _words(name: str) -> set[str]:
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", split_name(name)[0])
    return set(re.findall(r"[a-z0-9]+", spaced.lower()))


def _is_reference(name: str) -> bool:
    return bool(_words(name) & _REFERENCE)


def _alike(names: Sequence[str], spellings: Iterable[str], taken: set[int]) -> list[int]:
    """Columns that carry one of the spellings: as their whole name, else as one of their words."""
    wanted = set(spellings)
    exact = [i for i, name in enumerate(names) if i not in taken and _bare(name) in wanted]
    if exact:
        return exact
    long = {spelling for spelling in wanted if len(spelling) > 2}
    return [i for i, name in enumerate(names) if i not in taken and _words(name) & long]


def _shown(names: Sequence[str]) -> str:
    listed = ", ".join(name if name else f"column {i + 1}" for i, name in enumerate(names[:12]))
    return listed + (f" and {len(names) - 12} more" if len(names) > 12 else "")


def _said_column(path: str, role: str, said: str, names: Sequence[str]) -> int:
    """Column that the user names: exactly, then whatever the case, then without its unit, then by its number."""
    for same in (
        lambda name: name == said,
        lambda name: name.lower() == said.lower(),
        lambda name: split_name(name)[0].lower() == said.lower(),
    ):
        found = [i for i, name in enumerate(names) if same(name)]
        if len(found) == 1:
            return found[0]
        if found:
            numbers = ", ".join(str(i + 1) for i in found)
            raise DataError(
                f"{path}: {len(found)} columns are called {said} (columns {numbers}); "
                f"give its number instead: --columns {role}={found[0] + 1}"
            )
    if said.isdecimal() and 1 <= int(said) <= len(names):
        return int(said) - 1
    raise DataError(
        f"{path}: has no column {said} for --columns {role}={said}; its columns are {_shown(names)} "
        f"(a number counts them from 1)"
    )


def _only(path: str, role: str, found: list[int], names: Sequence[str]) -> int | None:
    if len(found) > 1:
        raise DataError(
            f"{path}: several columns may be the {role} ({_shown([names[i] or str(i + 1) for i in found])}); "
            f'say which with --columns {role}="{names[found[0]] or found[0] + 1}"'
        )
    return found[0] if found else None


def match_columns(path: str, sheet: Sheet, options: ReadOptions) -> Roles:
    """Roles of a sheet's columns; raises DataError where the output, or the time, cannot be told."""
    names = sheet.columns
    said = {role: _said_column(path, role, name, names) for role, name in options.columns.items()}
    for role, other in ((a, b) for a in said for b in said if a < b and said[a] == said[b]):
        raise UsageError(f"--columns: {role} and {other} are the same column, {names[said[role]] or said[role] + 1}")
    taken = set(said.values())
    nameless = not any(names)
    note = ""
    if nameless and "output" not in said:
        return _by_place(path, sheet, options, said)

    time = said.get("time")
    for group in TIME:
        if time is None:
            found = _alike(names, group, taken)
            time = sheet.clock if sheet.clock is not None else _only(path, "time", found, names)
    if time is None and not (options.rate_hz or sheet.rate_hz):
        raise DataError(
            f"{path}: no column is called time (columns: {_shown(names)}); name it with --columns time=NAME, "
            f"or give --rate HZ where the log has none"
        )
    if time is not None:
        taken.add(time)

    references = [i for i, name in enumerate(names) if i not in taken and _is_reference(name)]
    torques = [i for i in references if _words(names[i]) & set(OUTPUTS[0]) or _bare(names[i]).startswith("ref")]
    reference = said.get("reference", torques[0] if len(torques) == 1 else None)
    shut = taken | set(torques)

    output, unit = said.get("output"), "N·m" if nameless else ""
    if output is None:
        for group, unit_here in zip(OUTPUTS, OUTPUT_UNITS, strict=True):
            found = _alike(names, group, shut)
            if found:
                output, unit = _only(path, "output", found, names), unit_here
                break
    if output is None:
        raise DataError(
            f"{path}: no column is called torque (columns: {_shown(names)}); name what was measured with "
            f"--columns output=NAME"
        )
    if not unit:
        for group, unit_here in zip(OUTPUTS, OUTPUT_UNITS, strict=True):
            if _alike([names[output]], group, set()):
                unit = unit_here
                break

    inputs: list[tuple[Kind, int]] = []
    if "input" in said:
        inputs = [(options.kind or _kind_of(names[said["input"]], options.units.get("input", "")), said["input"])]
    else:
        for kind, groups in INPUTS.items():
            if options.kind in (None, kind):
                for group in groups:
                    found = _alike(names, group, shut | {output})
                    if found:
                        which = _only(path, "input", found, names)
                        assert which is not None
                        inputs.append((kind, which))
                        break
    return Roles(time, tuple(inputs), output, reference, unit, note)


def _kind_of(name: str, unit: str) -> Kind:
    """Experiment that a user's own choice of input column means."""
    for kind, groups in INPUTS.items():
        for group in groups:
            if _alike([name], group, set()):
                return kind
    unit = unit or split_name(name)[1]
    known = unit_of(unit) if unit else None
    quantity = known.quantity if known else ""
    return {"force": "friction-force", "pressure": "friction-force", "speed": "friction-speed"}.get(quantity, "clutch")  # type: ignore[return-value]


def _by_place(path: str, sheet: Sheet, options: ReadOptions, said: Mapping[str, int]) -> Roles:
    """Columns without names: time, input, output where there are three; time, output where there are two."""
    count = len(sheet.columns)
    rate = options.rate_hz or sheet.rate_hz
    places = {(3, False): (0, 1, 2), (2, False): (0, None, 1), (2, True): (None, 0, 1), (1, True): (None, None, 0)}
    if said or (count, bool(rate)) not in places:
        raise DataError(
            f"{path}: its {count} columns have no names; say what they are by number: --columns time=1,input=2,output=3"
        )
    time, input_, output = places[count, bool(rate)]
    order = ", ".join(["time"] * (time is not None) + ["input"] * (input_ is not None) + ["output"])
    kind = options.kind or "clutch"
    inputs = ((kind, input_),) if input_ is not None else ()
    return Roles(time, inputs, output, None, "N·m", f"its columns have no names: taken as {order}")


@dataclass(frozen=True)
class Scale:
    """Unit that a column is turned into, and the factor that does it."""

    unit: str
    factor: float


def scale_of(role: str, said: str | None, column: str, file_unit: str, default: str) -> Scale:
    """Unit and factor of a column: what the user says, else the file, else the column's name, else the default.

    A unit that eaid does not know is kept as it is, except for the time.
    """
    text = said if said is not None else (file_unit or split_name(column)[1] or default)
    known = unit_of(text) if text else None
    if role == "time":
        if known is None and said is None:
            known = unit_of("s")
        if known is None or known.quantity != "time":
            raise UsageError(f"--units time={said if said is not None else text}: is no unit of time; use {TIME_UNITS}")
    elif known is not None and known.quantity == "time":
        if said is not None:
            raise UsageError(f"--units {role}={said}: is a unit of time, not of the {role}")
        known = None
    if known is None:
        return Scale(text, 1.0)
    return Scale(known.to, known.factor)


def input_default(kind: Kind, column: str) -> str:
    """Unit of an input column that names none: the experiment's own, where the name says that quantity."""
    named = [
        unit for group, unit in zip(INPUTS[kind], _GROUP_UNITS[kind], strict=True) if _alike([column], group, set())
    ]
    return named[0] if named else INPUT_UNITS[kind]


_GROUP_UNITS: dict[Kind, tuple[str, ...]] = {
    "clutch": ("%", "%", "V"),
    "friction-force": ("N", "bar"),
    "friction-speed": ("RPM",),
}
