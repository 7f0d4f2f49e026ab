"""Units of logs: how they are spelled, what they measure, and their factor to the units of SPEC §1."""

import math
import re
from typing import NamedTuple


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
_define("time", "s", 60.0, "min", "minute", "minutes")
_define("time", "s", 3600.0, "h", "hour", "hours")
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
_define("pressure", "bar", 1.0, "bar", "bars")
_define("pressure", "bar", 1e-3, "mbar", "hpa")
_define("pressure", "bar", 1e-5, "pa")
_define("pressure", "bar", 1e-2, "kpa")
_define("pressure", "bar", 10.0, "mpa")
_define("pressure", "bar", 0.0689475729317831, "psi")

TIME_UNITS = "s, ms, us, ns, min or h"
_CASE_SENSITIVE = {"MPa": "mpa", "mPa": ""}  # the one pair of prefixes that case alone tells apart


def unit_of(text: str) -> Unit | None:
    """The unit behind a spelling (`mN·m`, `N*m`, `[ms]`, `Newtons`), or None where it is not known."""
    bare = text.strip().strip("[](){}").strip()
    if bare in _CASE_SENSITIVE:
        return _SPELLINGS.get(_CASE_SENSITIVE[bare])
    key = bare.replace("µ", "u").replace("μ", "u").lower()
    if key in _SPELLINGS:
        return _SPELLINGS[key]
    return _SPELLINGS.get(re.sub(r"[\s·*.⋅×_-]", "", key))


_BRACKETED = re.compile(r"^(.*?)\s*[\[({]\s*([^\])}]*?)\s*[\])}]\s*$")
_SUFFIX = re.compile(r"^(.*?)(?:_|\s*/\s*|\s+in\s+|,\s*|\s+)([^\s_/,]+)$")


def split_name(name: str) -> tuple[str, str]:
    """A column's bare name and the unit its name carries: `Torque (mNm)` → (`Torque`, `mNm`); unit empty where none."""
    found = _BRACKETED.match(name.strip())
    if found and found.group(1):
        return found.group(1).strip(), found.group(2)
    found = _SUFFIX.match(name.strip())
    if found and found.group(1) and unit_of(found.group(2)) is not None and found.group(2) not in ("1", "-"):
        return found.group(1).strip(" _/"), found.group(2)
    return name.strip(), ""
