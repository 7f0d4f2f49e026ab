"""The unit of an input or output column, and the factor that turns it into the unit that eaid computes in.

What nobody says is unknown: a torque without a unit is not taken for N·m.
"""

from dataclasses import dataclass

from eaid.errors import UsageError
from eaid.findings import Finding, finding
from eaid.logs.units import is_weight, split_name, unit_of

LARGEST_NM = 1000.0
"""Torque beyond any clutch that a bench holds [N·m]: a column of counts, or of another unit."""


@dataclass(frozen=True)
class Scale:
    """Unit that a column is turned into, and the factor that does it."""

    unit: str
    factor: float
    findings: tuple[Finding, ...] = ()


def scale_of(path: str, role: str, said: str | None, column: str, file_unit: str, default: str, label: str) -> Scale:
    """Unit and factor of a column: what the user says, else the file, else the column's name, else the default.

    A unit that eaid does not know is kept as it is. `/255` says that 255 counts are the full scale: an input in %.
    """
    if said is not None and said.startswith("/"):
        return _share(role, said)
    named = split_name(column)[1]
    text = said or file_unit or named
    known = unit_of(text) if text else None
    if known is not None and known.quantity == "time":
        if said is not None:
            raise UsageError(f"«units» {role}={said}: is a unit of time, not of the {role}")
        text, known = "", None
    if not text:
        if default == "%":  # a share: the levels tell whether it is one of 1 or of 100
            return Scale("%", 1.0)
        if default:
            return Scale(default, 1.0, (finding("unit-assumed", path, role=role, column=label, unit=default),))
        return Scale("", 1.0, (finding("unit-unknown", path, role=role, column=label),))
    if known is None:
        return Scale(text, 1.0)
    if text.strip("[]() ").lower() in ("g", "kg") and not is_weight(split_name(column)[0], said is not None):
        return Scale(text, 1.0, (finding("unit-g-unclear", path, role=role, column=label, unit=text),))
    return Scale(known.to, known.factor)


def _share(role: str, said: str) -> Scale:
    try:
        full = float(said[1:])
    except ValueError:
        full = 0.0
    if not 0 < full < float("inf"):
        raise UsageError(f"«units» {role}={said}: write a number above 0 behind the stroke, as in /255")
    return Scale("%", 100.0 / full) if role == "input" else Scale("", 1.0 / full)
