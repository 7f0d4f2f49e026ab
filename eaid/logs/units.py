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
from eaid.errors import UsageError
from eaid.findings import Finding, finding
from eaid.logs.table import LogTable

UNKNOWN = "a.u."  # The unit, arbitrary, of an input or output of which nobody says one


class Unit(NamedTuple):
    """A unit: what it measures (empty: it is not known), the unit it is turned into, and the factor."""

    quantity: str = ""
    to: str = ""
    factor: float = 1.0


_G = 9.80665  # m/s², standard gravity: a gram on a load cell is a gram-force
_LBF = 4.4482216152605

_UNITS: dict[tuple[str, str], dict[str, float]] = {
    ("time", "s"): {
        "s sec secs second seconds sek seg": 1.0, "ms msec millisecond milliseconds millis": 1e-3,
        "us usec microsecond microseconds micros": 1e-6, "ns nsec nanosecond nanoseconds": 1e-9,
        "min mins minute minutes": 60.0, "h hr hrs hour hours": 3600.0, "d day days": 86400.0,
    },
    ("torque", "N·m"): {
        "nm newtonmeter newtonmetre newtonmeters newtonmetres": 1.0, "mnm nmm": 1e-3, "ncm": 1e-2, "knm": 1e3,
        "unm": 1e-6, "kgfm kgm": _G, "kgfcm kgcm": _G * 1e-2, "gfcm gcm": _G * 1e-5,
        "lbfft lbft ftlb ftlbf": _LBF * 0.3048, "lbfin lbin inlb inlbf": _LBF * 0.0254,
        "ozin ozfin inoz": _LBF / 16 * 0.0254,
    },
    ("force", "N"): {
        "n newton newtons": 1.0, "mn": 1e-3, "kn": 1e3, "g gf gram grams": _G * 1e-3, "kg kgf": _G,
        "lbf lb lbs": _LBF,
    },
    ("speed", "RPM"): {
        "rpm 1/min r/min rev/min u/min min-1": 1.0, "rps rev/s hz": 60.0, "rad/s rads rad/sec": 30.0 / math.pi,
        "deg/s °/s dps deg/sec": 1.0 / 6.0,
    },
    ("duty", "%"): {"% pct percent prozent procent": 1.0, "fraction 1 ratio -": 100.0},
    ("voltage", "V"): {"v volt volts vdc": 1.0, "mv": 1e-3, "kv": 1e3},
    ("current", "A"): {"a amp amps ampere amperes": 1.0, "ma": 1e-3},
    ("pressure", "bar"): {
        "bar bars": 1.0, "mbar hpa": 1e-3, "pa": 1e-5, "kpa": 1e-2, "mpa": 10.0, "psi": 0.0689475729317831
    },
}  # fmt: skip
_SPELLINGS = {
    spelling: Unit(*into, factor)
    for into, units in _UNITS.items()
    for spellings, factor in units.items()
    for spelling in spellings.split()
}
TIME_UNITS = "s, ms, us, ns, min, h or d"
TIME_FACTORS = {unit: _SPELLINGS[unit].factor for unit in ("s", "ms", "us", "ns", "min", "h", "d")}  # Seconds in each
_CASE_SENSITIVE = {"MPa": "mpa", "mPa": "", "MN": "", "MNm": "", "MN·m": ""}  # prefixes that case alone tells apart
_WEIGHED = {"force", "load", "loadcell", "weight", "weighing", "scale", "friction", "tension", "pull", "push", "shear",
            "kraft", "kracht", "fuerza", "last", "cell", "fn", "ft", "thrust"}  # fmt: skip
_SHAKEN = {"acc", "accel", "acceleration", "accelerometer", "vibration", "vib", "imu", "shock", "ax", "ay", "az"}
# Names of columns that number the samples
COUNTERS = {"sample", "samples", "index", "idx", "count", "counter", "frame", "row", "tick", "ticks", "nr", "no", "n"}
_BRACKETED = re.compile(r"^(.*?)\s*[\[({]\s*([^\])}]*?)\s*[\])}]\s*$")
_INDEXED = re.compile(r"\S\[\d+\]$|[\[({]\s*(?:\d\d+|[02-9])\s*[\])}]$")  # ai0[1], Torque (2); `duty [1]` is a unit
_RATE = re.compile(r"^(.*?)(?:_|\.|\s+in\s+|,\s*|\s+)([^\s_/,.]+/[^\s_/,.]+)$")
DRIVING = {"duty", "voltage", "current", "force", "pressure", "speed"}  # Quantities that an input may be of
STAY = {"degC", "degF", "deg", "°C", "°", "mm"}  # Units that stay as they are, which end a name as others do
LINEAR_SPEED = re.compile(r"^(um|µm|mm|cm|m|in|ft)/(s|sec|min|h)$")
_SUFFIX = re.compile(r"^(.*?)(?:_|\.|\s*/\s*|\s+in\s+|,\s*|\s+)([^\s_/,.]+)$")
_CAMEL = re.compile(r"^(.*[a-z])((?:[A-Z][a-z]*)+|%)$")
_TIMES_A_NUMBER = re.compile(
    r"[*×]\s*[\d.]|\d\s*[*×]|/\s*\d|%\s*of\b|(?:^|[\s_()\[\]])[xX]\s*(?:10+|\d*\.\d+|\d+e[-+]?\d+)[\s)\]]*$|10\^[-+]?\d",
    re.IGNORECASE,
)
_NUMBER_OF_UNITS = re.compile(r"\d[\d.]*(?:e[-+]?\d+)?\s*[a-zA-Zµμ%]")


def may_drive(unit: str) -> bool:
    """Whether what is in a unit may be an input; one along a line, as of a sliding speed, too."""
    return unit_of(unit).quantity in DRIVING or LINEAR_SPEED.match(unit) is not None


def unit_of(text: str) -> Unit:
    """The unit behind a spelling (`mN·m`, `N*m`, `[ms]`, `Newtons`)."""
    bare = text.strip().strip("[](){}").strip()
    key = _CASE_SENSITIVE.get(bare, bare.replace("µ", "u").replace("μ", "u").lower())
    return _SPELLINGS.get(key) or _SPELLINGS.get(re.sub(r"[\s·*.⋅×_-]", "", key), Unit())


@lru_cache(1024)
def words_of(name: str) -> frozenset[str]:
    """The words of a column's name, in lower case: `shearForce_N` → shear, force, n."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return frozenset(re.findall(r"[a-z0-9]+", spaced.lower()))


@lru_cache(1024)
def split_name(name: str) -> tuple[str, str]:
    """A column's bare name and the unit its name carries: `Torque (mNm)` → (`Torque`, `mNm`); unit empty where none."""
    name = name.strip()
    match = None if _INDEXED.search(name) else _BRACKETED.match(name)
    if match and match.group(1):
        return match.group(1).strip(), match.group(2)
    for written in (_RATE, _SUFFIX):  # speed_rad/s is no speed_rad in s
        match = written.match(name)
        known = match and unit_of(match.group(2)).quantity and match.group(2) not in ("1", "-")
        if match and match.group(1) and (known or LINEAR_SPEED.match(match.group(2)) or match.group(2) in STAY):
            return match.group(1).strip(" _/."), match.group(2)
    match = _CAMEL.match(name)  # TorqueMnm, dutyPct, ForceN
    if match:
        for cut in range(1, len(name)):
            unit = name[cut:]
            if unit[0].isupper() and unit_of(unit).quantity and (len(unit) > 1 or unit in "NV"):
                return name[:cut], unit
    return name, ""


def numbers_samples(column: str) -> bool:
    """Whether a column counts the samples, by its name."""
    return bool(words_of(split_name(column)[0]) & COUNTERS)


@dataclass(frozen=True)
class Scale:
    """Unit that a column is turned into, and the factor that does it."""

    unit: str
    factor: float
    findings: tuple[Finding, ...] = ()

    def of(self, values: NDArray[Any]) -> Array:
        """Values of the column in that unit."""
        return read_only(values if self.factor == 1.0 else values * self.factor)


def declared_unit(table: LogTable, column: int, role: str, given: str | None) -> str:
    """The unit of a column as its file or its name says it; empty where neither does.

    Raises DataError for a number beside it (`x100`: multiply or divide?), and where the user says another unit.
    """
    name, file_unit = table.columns[column], table.unit(column)
    bare, named = split_name(name)
    text = file_unit or named
    known, other = unit_of(text), unit_of(named)
    if known.quantity == other.quantity and known != other:  # `Time [s]`, and ms in the row below
        if given is not None:
            return ""
        raise table.fault(
            f"column {name} says {named} in its name and {file_unit} beside it; say which with «units» "
            f"{role}={file_unit} or {role}={named}"
        )
    scaled = _TIMES_A_NUMBER.search(bare) or (
        not known.quantity and (_TIMES_A_NUMBER.search(text) or _NUMBER_OF_UNITS.match(text))
    )
    if scaled and given is None:
        raise table.fault(
            f"column {name}{f' in {file_unit}' * bool(file_unit)} holds a number beside its {role}'s unit, "
            f"which may multiply or divide; say the unit of its cells with «units» {role}=UNIT"
        )
    letter = len(named) == 1 and name.strip().endswith(f" {named}")  # Phase A
    if given is None or scaled or not known.quantity or letter or (known.quantity == "time") != (role == "time"):
        return text
    if role != "time" and unit_of(given) != known:
        raise table.fault(
            f"column {name} says {text}, «units» {role}={given} something else; leave it out, or mend the name"
        )
    return text


def scale_of(table: LogTable, column: int, role: str, given: str | None, default: str) -> Scale:
    """Unit and factor of a column: what the user says, else the file, else the column's name, else the default."""
    label = table.label(column)
    if unit_of(given or "").quantity == "time":
        raise UsageError(f"«units» {role}={given}: is a unit of time, not of the {role}")
    full = divisor(role, given) if given is not None and given.startswith("/") else 0.0
    text = declared_unit(table, column, role, given)
    if full:  # /255: so many counts are the full scale
        return Scale("%", 100.0 / full) if role == "input" else Scale("FS", 1.0 / full)
    text = given or text
    known = unit_of(text)
    if not text or known.quantity == "time":
        if default:
            return Scale(default, 1.0, (finding("unit-assumed", role, role=role, column=label, unit=default),))
        column_said = role if label == role else f"{role} {label}"
        return Scale(UNKNOWN, 1.0, (finding("unit-unknown", role, column=column_said, ask=f"{role}=UNIT"),))
    if not known.quantity:
        return Scale(text, 1.0)  # one that eaid does not know stays as it is
    if text.strip("[]() ").lower() in ("g", "kg"):
        words = words_of(split_name(table.columns[column])[0])
        if words & _SHAKEN or not (given or words & _WEIGHED):
            return Scale(text, 1.0, (finding("unit-g-unclear", role, role=role, column=label, unit=text),))
    return Scale(known.to, known.factor)


def divisor(role: str, given: str) -> float:
    """The number of a unit written as `/255`: counts of a full scale, or a second; UsageError where it is none."""
    try:
        counts = float(given[1:])
    except ValueError:
        counts = 0.0
    if not 1e-12 <= counts <= 1e12:
        raise UsageError(f"«units» {role}={given}: write a number from 1e-12 to 1e12 behind the stroke, as in /255")
    return counts
