"""Units of logs: how they are spelled, what they measure, and their factor to the unit that eaid computes in.

Torque becomes N·m, force N, speed RPM, duty %, pressure bar, voltage V, time s; any other unit stays as it is. What
nobody says is unknown: a torque without a unit is not taken for N·m.
"""

import math
import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

from numpy.typing import NDArray

from eaid.arrays import Array, read_only
from eaid.errors import DataError, UsageError
from eaid.findings import Finding, finding

LARGEST_NM = 1000.0
"""Torque beyond any clutch that a bench holds [N·m]: a column of counts, or of another unit."""


class Unit(NamedTuple):
    """A unit: what it measures, the unit it is turned into, and the factor."""

    quantity: str
    to: str
    factor: float


_G = 9.80665  # m/s², standard gravity: a gram on a load cell is a gram-force
_LBF = 4.4482216152605

_SPELLINGS: dict[str, Unit] = {}


def _define(quantity: str, to: str, factor: float, *spellings: str) -> None:
    for spelling in spellings:
        _SPELLINGS[spelling] = Unit(quantity, to, factor)


_define("time", "s", 1.0, "s", "sec", "secs", "second", "seconds", "sek", "seg")
_define("time", "s", 1e-3, "ms", "msec", "millisecond", "milliseconds", "millis")
_define("time", "s", 1e-6, "us", "usec", "microsecond", "microseconds", "micros")
_define("time", "s", 1e-9, "ns", "nsec", "nanosecond", "nanoseconds")
_define("time", "s", 60.0, "min", "mins", "minute", "minutes")
_define("time", "s", 3600.0, "h", "hr", "hrs", "hour", "hours")
_define("time", "s", 86400.0, "d", "day", "days")
_define("torque", "N·m", 1.0, "nm", "newtonmeter", "newtonmetre", "newtonmeters", "newtonmetres")
_define("torque", "N·m", 1e-3, "mnm")
_define("torque", "N·m", 1e-2, "ncm")
_define("torque", "N·m", 1e-3, "nmm")
_define("torque", "N·m", 1e3, "knm")
_define("torque", "N·m", 1e-6, "unm")
_define("torque", "N·m", _G, "kgfm", "kgm")
_define("torque", "N·m", _G * 1e-2, "kgfcm", "kgcm")
_define("torque", "N·m", _G * 1e-5, "gfcm", "gcm")
_define("torque", "N·m", _LBF * 0.3048, "lbfft", "lbft", "ftlb", "ftlbf")
_define("torque", "N·m", _LBF * 0.0254, "lbfin", "lbin", "inlb", "inlbf")
_define("torque", "N·m", _LBF / 16 * 0.0254, "ozin", "ozfin", "inoz")
_define("force", "N", 1.0, "n", "newton", "newtons")
_define("force", "N", 1e-3, "mn")
_define("force", "N", 1e3, "kn")
_define("force", "N", _G * 1e-3, "g", "gf", "gram", "grams")
_define("force", "N", _G, "kg", "kgf")
_define("force", "N", _LBF, "lbf", "lb", "lbs")
_define("speed", "RPM", 1.0, "rpm", "1/min", "r/min", "rev/min", "u/min", "min-1")
_define("speed", "RPM", 60.0, "rps", "rev/s", "hz")
_define("speed", "RPM", 30.0 / math.pi, "rad/s", "rads", "rad/sec")
_define("speed", "RPM", 1.0 / 6.0, "deg/s", "°/s", "dps", "deg/sec")
_define("duty", "%", 1.0, "%", "pct", "percent", "prozent", "procent")
_define("duty", "%", 100.0, "fraction", "1", "ratio", "-")
_define("voltage", "V", 1.0, "v", "volt", "volts", "vdc")
_define("voltage", "V", 1e-3, "mv")
_define("voltage", "V", 1e3, "kv")
_define("current", "A", 1.0, "a", "amp", "amps", "ampere", "amperes")
_define("current", "A", 1e-3, "ma")
_define("pressure", "bar", 1.0, "bar", "bars")
_define("pressure", "bar", 1e-3, "mbar", "hpa")
_define("pressure", "bar", 1e-5, "pa")
_define("pressure", "bar", 1e-2, "kpa")
_define("pressure", "bar", 10.0, "mpa")
_define("pressure", "bar", 0.0689475729317831, "psi")

TIME_UNITS = "s, ms, us, ns, min, h or d"
_CASE_SENSITIVE = {"MPa": "mpa", "mPa": "", "MNm": "", "MN·m": ""}  # prefixes that case alone tells apart
_WEIGHED = {"force", "load", "loadcell", "weight", "weighing", "scale", "friction", "tension", "pull", "push", "shear",
            "kraft", "kracht", "fuerza", "last", "cell", "fn", "ft", "thrust"}  # fmt: skip
_SHAKEN = {"acc", "accel", "acceleration", "accelerometer", "vibration", "vib", "imu", "shock", "ax", "ay", "az"}


def unit_of(text: str) -> Unit | None:
    """The unit behind a spelling (`mN·m`, `N*m`, `[ms]`, `Newtons`), or None where it is not known."""
    bare = text.strip().strip("[](){}").strip()
    if bare in _CASE_SENSITIVE:
        return _SPELLINGS.get(_CASE_SENSITIVE[bare])
    key = bare.replace("µ", "u").replace("μ", "u").lower()
    if key in _SPELLINGS:
        return _SPELLINGS[key]
    return _SPELLINGS.get(re.sub(r"[\s·*.⋅×_-]", "", key))


def likely_time_unit(usual: float) -> str:
    """Unit of a clock whose stamps are so far apart, if it is not s: the coarsest that makes half a second or less."""
    return next((unit for unit in ("ms", "us", "ns") if usual * _SPELLINGS[unit].factor <= 0.5), "ns")


@lru_cache(1024)
def words_of(name: str) -> frozenset[str]:
    """The words of a column's name, in lower case: `shearForce_N` → shear, force, n."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return frozenset(re.findall(r"[a-z0-9]+", spaced.lower()))


def is_weight(name: str, said: bool) -> bool:
    """Whether a column in g or kg is a force: by its name; where that tells nothing, only if the user says the unit."""
    words = words_of(name)
    return not words & _SHAKEN and (said or bool(words & _WEIGHED))


_BRACKETED = re.compile(r"^(.*?)\s*[\[({]\s*([^\])}]*?)\s*[\])}]\s*$")
_RATE = re.compile(r"^(.*?)(?:_|\.|\s+in\s+|,\s*|\s+)([^\s_/,.]+/[^\s_/,.]+)$")
_SPEED = re.compile(r"^(um|µm|mm|cm|m|in|ft)/(s|sec|min|h)$")
_SUFFIX = re.compile(r"^(.*?)(?:_|\.|\s*/\s*|\s+in\s+|,\s*|\s+)([^\s_/,.]+)$")
_CAMEL = re.compile(r"^(.*[a-z])((?:[A-Z][a-z]*)+|%)$")


@lru_cache(1024)
def split_name(name: str) -> tuple[str, str]:
    """A column's bare name and the unit its name carries: `Torque (mNm)` → (`Torque`, `mNm`); unit empty where none."""
    name = name.strip()
    found = _BRACKETED.match(name)
    if found and found.group(1):
        return found.group(1).strip(), found.group(2)
    for written in (_RATE, _SUFFIX):  # speed_rad/s is no speed_rad in s
        found = written.match(name)
        known = found and (unit_of(found.group(2)) is not None and found.group(2) not in ("1", "-"))
        if found and found.group(1) and (known or _SPEED.match(found.group(2))):
            return found.group(1).strip(" _/."), found.group(2)
    found = _CAMEL.match(name)  # TorqueMnm, dutyPct, ForceN
    if found:
        for cut in range(1, len(name)):
            unit = name[cut:]
            if unit[0].isupper() and unit_of(unit) is not None and (len(unit) > 1 or unit in "NV"):
                return name[:cut], unit
    return name, ""


_TIMES_A_NUMBER = re.compile(
    r"[*×]\s*[\d.]|\d\s*[*×]|/\s*\d|%\s*of\b|(?:^|[\s_()\[\]])[xX]\s*(?:10+|\d*\.\d+|\d+e[-+]?\d+)[\s)\]]*$|10\^[-+]?\d",
    re.IGNORECASE,
)
_NUMBER_OF_UNITS = re.compile(r"\d[\d.]*(?:e[-+]?\d+)?\s*[a-zA-Zµμ%]")


@dataclass(frozen=True)
class Scale:
    """Unit that a column is turned into, and the factor that does it."""

    unit: str
    factor: float
    findings: tuple[Finding, ...] = ()

    def of(self, values: NDArray[Any]) -> Array:
        """Values of the column in that unit."""
        return read_only(values if self.factor == 1.0 else values * self.factor)


def unit_said(path: str, role: str, said: str | None, column: str, file_unit: str) -> str:
    """The unit of a column as its file or its name says it; empty where neither does, or it is one of another quantity.

    Raises DataError where a number stands beside it (`x100`, `Nm*1e-2`: multiply or divide?) and the user says no unit,
    and UsageError where the user says another unit than the column does.
    """
    bare, named = split_name(column)
    text = file_unit or named
    known = unit_of(text) if text else None
    scaled = _TIMES_A_NUMBER.search(bare) or (
        known is None and (_TIMES_A_NUMBER.search(text) or _NUMBER_OF_UNITS.match(text))
    )
    if scaled and said is None:
        raise DataError(
            f"{path}: column {column}{f' in {file_unit}' * bool(file_unit)} holds a number beside its {role}'s unit, "
            f"which may multiply or divide; say the unit of its cells with «units» {role}=UNIT"
        )
    letter = len(named) == 1 and column.strip().endswith(f" {named}")  # Phase A
    if said is None or scaled or known is None or letter or (known.quantity == "time") != (role == "time"):
        return text
    if role != "time" and unit_of(said) != known:
        raise DataError(
            f"{path}: column {column} says {text}, «units» {role}={said} something else; leave it out, or mend the name"
        )
    return text


def scale_of(path: str, role: str, said: str | None, column: str, file_unit: str, default: str, label: str) -> Scale:
    """Unit and factor of a column: what the user says, else the file, else the column's name, else the default.

    A unit that eaid does not know is kept as it is. `/255` says that 255 counts are the full scale: an input in %.
    """
    known = unit_of(said) if said else None
    if known is not None and known.quantity == "time":
        raise UsageError(f"«units» {role}={said}: is a unit of time, not of the {role}")
    full = divisor(role, said) if said is not None and said.startswith("/") else 0.0
    text = unit_said(path, role, said, column, file_unit)
    if full:
        return Scale("%", 100.0 / full) if role == "input" else Scale("", 1.0 / full)
    text = said or text
    known = unit_of(text) if text else None
    if known is not None and known.quantity == "time":
        text, known = "", None
    if not text:
        code = "unit-assumed" if default else "unit-unknown"
        return Scale(default, 1.0, (finding(code, path, role=role, column=label, unit=default),))
    if known is None:
        return Scale(text, 1.0)
    if text.strip("[]() ").lower() in ("g", "kg") and not is_weight(split_name(column)[0], said is not None):
        return Scale(text, 1.0, (finding("unit-g-unclear", path, role=role, column=label, unit=text),))
    return Scale(known.to, known.factor)


def divisor(role: str, said: str) -> float:
    """The number of a unit that is said as `/255`: counts of a full scale, or a second; UsageError where it is none."""
    try:
        counts = float(said[1:])
    except ValueError:
        counts = 0.0
    if not 1e-12 <= counts <= 1e12:
        raise UsageError(f"«units» {role}={said}: write a number from 1e-12 to 1e12 behind the stroke, as in /255")
    return counts
