"""Units of logs: how they are spelled, what they measure, their factor to the unit that eaid computes in, and clocks.

Torque becomes N·m, force N, speed RPM, duty %, pressure bar, voltage V, time s; any other unit stays as it is. What
nobody says is unknown: a torque without a unit is not taken for N·m.
"""

import math
import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array, read_only
from eaid.errors import DataError, UsageError
from eaid.findings import Finding, finding
from eaid.logs.table import Table

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
_CASE_SENSITIVE = {"MPa": "mpa", "mPa": "", "MNm": "", "MN·m": ""}  # prefixes that case alone tells apart
_WEIGHED = {"force", "load", "loadcell", "weight", "weighing", "scale", "friction", "tension", "pull", "push", "shear",
            "kraft", "kracht", "fuerza", "last", "cell", "fn", "ft", "thrust"}  # fmt: skip
_SHAKEN = {"acc", "accel", "acceleration", "accelerometer", "vibration", "vib", "imu", "shock", "ax", "ay", "az"}


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


# Names of columns that number the samples
COUNTERS = {"sample", "samples", "index", "idx", "count", "counter", "frame", "row", "tick", "ticks", "nr", "no", "n"}
_BRACKETED = re.compile(r"^(.*?)\s*[\[({]\s*([^\])}]*?)\s*[\])}]\s*$")
_RATE = re.compile(r"^(.*?)(?:_|\.|\s+in\s+|,\s*|\s+)([^\s_/,.]+/[^\s_/,.]+)$")
_SPEED = re.compile(r"^(um|µm|mm|cm|m|in|ft)/(s|sec|min|h)$")
_SUFFIX = re.compile(r"^(.*?)(?:_|\.|\s*/\s*|\s+in\s+|,\s*|\s+)([^\s_/,.]+)$")
_CAMEL = re.compile(r"^(.*[a-z])((?:[A-Z][a-z]*)+|%)$")


def is_linear_speed(unit: str) -> bool:
    """Whether a unit is one as mm/s."""
    return _SPEED.match(unit) is not None


@lru_cache(1024)
def split_name(name: str) -> tuple[str, str]:
    """A column's bare name and the unit its name carries: `Torque (mNm)` → (`Torque`, `mNm`); unit empty where none."""
    name = name.strip()
    match = _BRACKETED.match(name)
    if match and match.group(1):
        return match.group(1).strip(), match.group(2)
    for written in (_RATE, _SUFFIX):  # speed_rad/s is no speed_rad in s
        match = written.match(name)
        known = match and unit_of(match.group(2)).quantity and match.group(2) not in ("1", "-")
        if match and match.group(1) and (known or _SPEED.match(match.group(2))):
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


def declared_unit(path: str, role: str, given: str | None, table: Table, column: int) -> str:
    """The unit of a column as its file or its name says it; empty where neither does.

    Raises DataError for a number beside it (`x100`: multiply or divide?), and where the user says another unit.
    """
    name, file_unit = table.columns[column], table.unit(column)
    bare, named = split_name(name)
    text = file_unit or named
    known = unit_of(text)
    scaled = _TIMES_A_NUMBER.search(bare) or (
        not known.quantity and (_TIMES_A_NUMBER.search(text) or _NUMBER_OF_UNITS.match(text))
    )
    if scaled and given is None:
        raise DataError(
            f"{path}: column {name}{f' in {file_unit}' * bool(file_unit)} holds a number beside its {role}'s unit, "
            f"which may multiply or divide; say the unit of its cells with «units» {role}=UNIT"
        )
    letter = len(named) == 1 and name.strip().endswith(f" {named}")  # Phase A
    if given is None or scaled or not known.quantity or letter or (known.quantity == "time") != (role == "time"):
        return text
    if role != "time" and unit_of(given) != known:
        raise DataError(
            f"{path}: column {name} says {text}, «units» {role}={given} something else; leave it out, or mend the name"
        )
    return text


def scale_of(path: str, role: str, given: str | None, table: Table, column: int, default: str) -> Scale:
    """Unit and factor of a column: what the user says, else the file, else the column's name, else the default."""
    label = table.label(column)
    if unit_of(given or "").quantity == "time":
        raise UsageError(f"«units» {role}={given}: is a unit of time, not of the {role}")
    full = divisor(role, given) if given is not None and given.startswith("/") else 0.0
    text = declared_unit(path, role, given, table, column)
    if full:  # /255: so many counts are the full scale
        return Scale("%", 100.0 / full) if role == "input" else Scale("FS", 1.0 / full)
    text = given or text
    known = unit_of(text)
    if not text or known.quantity == "time":
        if default:
            return Scale(default, 1.0, (finding("unit-assumed", path, role=role, column=label, unit=default),))
        column_said = role if label == role else f"{role} {label}"
        return Scale(UNKNOWN, 1.0, (finding("unit-unknown", path, column=column_said, ask=f"{role}=UNIT"),))
    if not known.quantity:
        return Scale(text, 1.0)  # one that eaid does not know stays as it is
    if text.strip("[]() ").lower() in ("g", "kg"):
        words = words_of(split_name(table.columns[column])[0])
        if words & _SHAKEN or not (given or words & _WEIGHED):
            return Scale(text, 1.0, (finding("unit-g-unclear", path, role=role, column=label, unit=text),))
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


# What a clock counts that began at a fixed day, how many of it a second, and its first stamps of our time [s]
CLOCKS = (
    *((f"{unit} since 1970", per_s, 1e9, 4e9) for unit, per_s in (("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9))),
    ("100 ns since 1601 (FILETIME)", 1e7, 1.26e10, 1.56e10),
    ("100 ns since the year 1 (.NET)", 1e7, 6.31e10, 6.61e10),
)
# Sample time beyond which a clock without a unit counts not from a fixed day, but in a finer unit from power-up
SLOWEST_CLOCK_S = 90.0
FASTEST_HZ = 50_000.0  # Sample rate beyond which a clock whose unit nobody gave is warned of
BRIEF_S, QUICK_HZ = 2.0, 2000.0  # Span and sample rate of a log that may be one of minutes, if nobody gave the unit
# Span beyond which a clock whose unit nobody gave counts no seconds, if it counts whole numbers, or seldom
LONGEST_S = 3600.0


def time_unit(path: str, given: str | None, table: Table, column: int) -> tuple[float | None, float | None]:
    """Seconds in one unit of a time column, as the user says, and as its file or its name does; None where not."""
    by_user = None
    if given is not None:
        known = unit_of(given)
        if not given.startswith("/") and known.quantity != "time":
            raise UsageError(f"«units» time={given}: is no unit of time; use {TIME_UNITS}")
        by_user = known.factor if known.quantity else 1.0 / divisor("time", given)
    name = table.columns[column]
    bare = split_name(name)[0]
    text = declared_unit(path, "time", given, table, column)
    known = unit_of(text or (bare if len(bare) > 1 or bare == "s" else ""))
    if known.quantity == "time":
        return by_user, known.factor
    if text and by_user is None:
        raise DataError(
            f"{path}: column {name} is in {text}, which is no unit of time that eaid knows; "
            f"say it with «units» time=UNIT ({TIME_UNITS})"
        )
    return by_user, None


def seconds_since_start(
    path: str, column: str, raw: NDArray[Any], by_user: float | None, by_column: float | None
) -> tuple[Array, float, tuple[Finding, ...]]:
    """Time since the first sample [s], shape (n,), the clock there [s], and its warnings.

    `raw` rises; `by_user`, `by_column`: seconds in one unit of it, as far as somebody says.
    """
    first = raw[0]
    gone = read_only(raw - first)
    usual = float(np.median(np.diff(gone[:10_000]))) if len(gone) > 1 else 0.0
    factor, findings = by_user or by_column or 1.0, list[Finding]()
    days = ((counts, per_s) for counts, per_s, low, high in CLOCKS if low <= float(first) / per_s <= high)
    counts, per_s = next(days, ("", 0.0))
    refuted = bool(counts) and by_column is not None and not math.isclose(by_column * per_s, 1.0)
    too_fast = by_column is not None and 0 < usual * by_column < 1.0 / (5e6 if by_column > 1e-6 else 5e9)
    if by_user is not None:
        if by_column is not None and not (refuted or too_fast) and not math.isclose(by_user, by_column):
            raise DataError(
                f"{path}: column {column} says its unit, «units» time=UNIT another; leave it out, or mend the name"
            )
    elif refuted:
        raise DataError(
            f"{path}: column {column} says its unit, but its first stamp, {float(first):.10g}, counts {counts}; "
            f"say which with «units» time=UNIT"
        )
    elif too_fast:
        findings.append(_unclear(path, column, usual, float(gone[-1]), "d", factor))
    elif by_column is None:
        if numbers_samples(column) and usual == 1.0:
            raise DataError(
                f"{path}: column {column} numbers the samples and is no time; give their rate with «rate_hz» HZ and "
                f"name no time column, or say «units» time=/1000 for 1000 samples a second"
            )
        late = np.flatnonzero(np.diff(raw) >= 40)  # times of day as numbers, 161859.9 and then 161900.0
        ends, begins = raw[late] % 100, raw[late + 1] % 100
        if len(late) and float(raw[-1]) < 240_000 and bool(((ends >= 59) & (ends < 60) & (begins < 1)).all()):
            raise DataError(
                f"{path}: column {column} holds times of day as numbers, {raw[late[0]]:.10g} and then "
                f"{raw[late[0] + 1]:.10g}; save it as 16:18:59.9, or in seconds"
            )
        if counts and usual / per_s <= SLOWEST_CLOCK_S:
            factor = 1.0 / per_s
            if per_s != 1:
                findings.append(finding("time-since-a-day", path, column=column, counts=counts))
        else:
            findings.append(_of_seconds(path, column, gone, usual))
    return read_only(gone if factor == 1.0 else gone * factor), float(first) * factor, tuple(findings)


def _of_seconds(path: str, column: str, gone: Array, usual: float) -> Finding:
    """That seconds are assumed of a clock whose unit nobody gave, and what speaks against them."""
    span, too_fast = float(gone[-1]), 0 < usual < 1.0 / FASTEST_HZ
    whole = usual >= 1.0 and bool(np.all(gone[:100_000] == np.floor(gone[:100_000])))
    brief = 0 < usual < 1.0 / QUICK_HZ and span < BRIEF_S

    def off(unit: str) -> float:  # from a hundred samples a second, and from a minute in all
        return sum(abs(math.log(size * TIME_FACTORS[unit])) for size in (usual / 0.01, span / 60))

    # if it counts no seconds: the coarsest unit with half a second a sample, and an hour in all, at most
    finer = (one for one in ("ms", "us") if max(usual / 0.5, span / LONGEST_S) * TIME_FACTORS[one] <= 1)
    likely = min(("min", "h", "d"), key=off) if brief or too_fast else next(finer, "ns")
    if too_fast or (span > LONGEST_S and (whole or usual > SLOWEST_CLOCK_S)):
        return _unclear(path, column, usual, span, likely)
    if whole or brief:
        return finding("time-doubtful", path, column=column, usual_s=usual, span_s=span, likely=likely)
    return finding("unit-assumed", path, role="time", column=column, unit="s")


def _unclear(path: str, column: str, usual: float, span: float, likely: str, factor: float = 1.0) -> Finding:
    """The question which unit a clock counts: the one that is likely, or that of its header, in the end seconds."""
    own = next(unit for unit, size in TIME_FACTORS.items() if math.isclose(size, factor))
    likely_s, own_s = span * TIME_FACTORS[likely], span * factor
    return finding(
        "time-unclear", path, column=column, usual=usual, span=span, likely=likely, own=own, likely_s=likely_s,
        own_s=own_s,
    )  # fmt: skip
