"""Every unit factor against pint, which knows nothing of eaid; every spelling of the table stands here."""

import numpy as np
import pint
import pytest

from eaid.errors import UsageError
from eaid.logs.units import _SPELLINGS, Scale, is_weight, scale_of, split_name, unit_of, words_of

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


@pytest.mark.parametrize(
    ("column", "said", "of_file", "default", "unit", "factor", "codes"),
    [
        ("torque", None, "", "N·m", "N·m", 1.0, ["unit-assumed"]), ("torque", None, "", "", "", 1.0, ["unit-unknown"]),
        ("duty", None, "", "%", "%", 1.0, []), ("torque", None, "mNm", "N·m", "N·m", 1e-3, []),
        ("torque_ncm", None, "mNm", "", "N·m", 1e-3, []),  # the file before the name
        ("torque_ncm", None, "", "", "N·m", 1e-2, []), ("torque_ncm", "kNm", "mNm", "", "N·m", 1e3, []),
        ("torque", None, "bits", "N·m", "bits", 1.0, []), ("torque", "bits", "mNm", "", "bits", 1.0, []),
        ("u", "/200", "V", "", "%", 0.5, []), ("u", "fraction", "", "%", "%", 100.0, []),
        ("u_ms", None, "", "%", "%", 1.0, []), ("u", None, "s", "", "", 1.0, ["unit-unknown"]),  # no unit of an input
        ("force", None, "g", "N", "N", 9.80665e-3, []), ("accel", None, "g", "N", "g", 1.0, ["unit-g-unclear"]),
        ("output", None, "g", "", "g", 1.0, ["unit-g-unclear"]), ("output", "g", "", "", "N", 9.80665e-3, []),
        ("accel force", "kg", "", "", "kg", 1.0, ["unit-g-unclear"]), ("output", None, "gf", "", "N", 9.80665e-3, []),
        ("output [kg]", None, "", "", "kg", 1.0, ["unit-g-unclear"]), ("load", None, "[kg]", "", "N", 9.80665, []),
    ],
)  # fmt: skip
def test_who_says_the_unit(
    column: str, said: str | None, of_file: str, default: str, unit: str, factor: float, codes: list[str]
) -> None:
    found = scale_of("log", "input", said, column, of_file, default, column)
    assert (found.unit, [one.code for one in found.findings]) == (unit, codes)
    assert found.factor == pytest.approx(factor, rel=1e-12)
    assert found.of(np.array([2.0, -1.0])).tolist() == pytest.approx([2 * factor, -factor])
    assert scale_of("log", "output", "/4", "x", "V", "", "x") == Scale("", 0.25)


def test_a_unit_of_time_is_none_of_a_torque() -> None:
    with pytest.raises(UsageError, match="output=ms: is a unit of time, not of the output"):
        scale_of("log", "output", "ms", "torque", "", "", "torque")


@pytest.mark.parametrize(
    ("name", "split"),
    [
        ("a", ("a", "")), ("Torque (mNm)", ("Torque", "mNm")), (" t [s] ", ("t", "s")), ("(s)", ("(s)", "")),
        ("a {V}", ("a", "V")), ("a [what]", ("a", "what")), ("a_what", ("a_what", "")), ("ratio_1", ("ratio_1", "")),
        ("a -", ("a -", "")), ("x, N", ("x", "N")), ("x / N", ("x", "N")),
        ("speed_rad/s", ("speed", "rad/s")), ("omega in rad/s", ("omega", "rad/s")), ("n 1/min", ("n", "1/min")),
        ("velocity_mm/s", ("velocity", "mm/s")), ("speed in m/min", ("speed", "m/min")), ("Zeit t/s", ("Zeit t", "s")),
        ("Drehzahl, U/min", ("Drehzahl", "U/min")), ("Zeit/s", ("Zeit", "s")), ("a b/s", ("a b", "s")),
        ("a_b/c", ("a_b/c", "")),
        ("forceN", ("force", "N")), ("levelV", ("level", "V")), ("planA", ("planA", "")), ("ForceMn", ("Force", "Mn")),
        ("dutyCycle", ("dutyCycle", "")), ("u%", ("u%", "")), ("a b_kV", ("a b", "kV")), ("s", ("s", "")),
    ],
)  # fmt: skip
def test_names_and_their_units(name: str, split: tuple[str, str]) -> None:
    assert split_name(name) == split


def test_words_of_a_name() -> None:
    assert words_of("shearForce_N2") == {"shear", "force", "n2"}
    assert words_of("Load-Cell [kg]") == {"load", "cell", "kg"}
    assert [is_weight(name, said) for name in ("force", "x", "acc force") for said in (False, True)] == [
        True, True, False, True, False, False,
    ]  # fmt: skip
