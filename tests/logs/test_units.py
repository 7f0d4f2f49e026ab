"""Every unit factor against pint, which knows nothing of eaid; every spelling of the table stands here."""

import pint
import pytest

from eaid.logs.units import _SPELLINGS, split_name, unit_of

PINT = {
    "second": ("s", "sec", "secs", "second", "seconds", "sek", "seg"),
    "millisecond": ("ms", "msec", "millisecond", "milliseconds", "millis"),
    "microsecond": ("us", "usec", "microsecond", "microseconds", "micros"),
    "nanosecond": ("ns", "nsec", "nanosecond", "nanoseconds"),
    "minute": ("min", "mins", "minute", "minutes"),
    "hour": ("h", "hr", "hrs", "hour", "hours"),
    "day": ("d", "day", "days"),
    "newton * meter": ("nm", "newtonmeter", "newtonmetre", "newtonmeters", "newtonmetres"),
    "millinewton * meter": ("mnm",),
    "newton * centimeter": ("ncm",),
    "newton * millimeter": ("nmm",),
    "kilonewton * meter": ("knm",),
    "micronewton * meter": ("unm",),
    "kilogram_force * meter": ("kgfm", "kgm"),
    "kilogram_force * centimeter": ("kgfcm", "kgcm"),
    "gram_force * centimeter": ("gfcm", "gcm"),
    "pound_force * foot": ("lbfft", "lbft", "ftlb", "ftlbf"),
    "pound_force * inch": ("lbfin", "lbin", "inlb", "inlbf"),
    "ounce_force * inch": ("ozin", "ozfin", "inoz"),
    "newton": ("n", "newton", "newtons"),
    "millinewton": ("mn",),
    "kilonewton": ("kn",),
    "gram_force": ("g", "gf", "gram", "grams"),
    "kilogram_force": ("kg", "kgf"),
    "pound_force": ("lbf", "lb", "lbs"),
    "revolution / minute": ("rpm", "1/min", "r/min", "rev/min", "u/min", "min-1"),
    "revolution / second": ("rps", "rev/s", "hz"),
    "radian / second": ("rad/s", "rads", "rad/sec"),
    "degree / second": ("deg/s", "°/s", "dps", "deg/sec"),
    "percent": ("%", "pct", "percent", "prozent", "procent"),
    "dimensionless": ("fraction", "1", "ratio", "-"),
    "volt": ("v", "volt", "volts", "vdc"),
    "millivolt": ("mv",),
    "kilovolt": ("kv",),
    "ampere": ("a", "amp", "amps", "ampere", "amperes"),
    "milliampere": ("ma",),
    "bar": ("bar", "bars"),
    "millibar": ("mbar", "hpa"),
    "pascal": ("pa",),
    "kilopascal": ("kpa",),
    "megapascal": ("mpa",),
    "pound_force_per_square_inch": ("psi",),
}
INTO = {"s": "second", "N·m": "newton * meter", "N": "newton", "RPM": "revolution / minute", "%": "percent",
        "V": "volt", "A": "ampere", "bar": "bar"}  # fmt: skip


def test_every_spelling_stands_in_the_table() -> None:
    assert {spelling for spellings in PINT.values() for spelling in spellings} == set(_SPELLINGS)


@pytest.mark.parametrize("name", PINT)
def test_factor(name: str) -> None:
    units = pint.UnitRegistry()
    for spelling in PINT[name]:
        known = unit_of(spelling)
        assert known is not None
        assert known.factor == pytest.approx(units.Quantity(1.0, name).to(INTO[known.to]).magnitude, rel=1e-12)


@pytest.mark.parametrize(
    ("written", "name"),
    [("N·m", "newton * meter"), ("[mN m]", "millinewton * meter"), ("N*cm", "newton * centimeter"),
     ("kgf·cm", "kilogram_force * centimeter"), ("gf·cm", "gram_force * centimeter"), ("µs", "microsecond"),
     ("μs", "microsecond"), ("MPa", "megapascal"), ("ft-lb", "pound_force * foot"), ("oz_in", "ounce_force * inch"),
     ("U/min", "revolution / minute"), ("mBar", "millibar"), ("{mV}", "millivolt")],
)  # fmt: skip
def test_as_rigs_write_it(written: str, name: str) -> None:
    known = unit_of(written)
    assert known is not None
    assert known.factor == pytest.approx(
        pint.UnitRegistry().Quantity(1.0, name).to(INTO[known.to]).magnitude, rel=1e-12
    )


@pytest.mark.parametrize("written", ["mPa", "MNm", "MN·m", "m", "mm/s^2", "°C", "counts", "N/m", "Ohm", "W", "dB", ""])
def test_what_is_no_unit_of_eaid(written: str) -> None:
    assert unit_of(written) is None


@pytest.mark.parametrize(
    ("column", "bare", "unit"),
    [("torque.mNm", "torque", "mNm"), ("TorqueMnm", "Torque", "Mnm"), ("Torque / Nm", "Torque", "Nm"),
     ("Zeit in ms", "Zeit", "ms"), ("Force,N", "Force", "N"), ("time", "time", ""), ("T1", "T1", ""),
     ("Spannung", "Spannung", ""), ("Load Cell (g)", "Load Cell", "g"), ("dutyPct", "dutyPct"[:4], "Pct")],
)  # fmt: skip
def test_the_unit_in_a_name(column: str, bare: str, unit: str) -> None:
    assert split_name(column) == (bare, unit)
