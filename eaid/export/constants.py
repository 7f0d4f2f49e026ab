"""Gains and plant → the constants of `eaid.export.reference` at one sample time, each with its unit and meaning.

PI, RC    the gains as they are; tanh(γε) once, Eq. (14)
inverse   observer poles at e^(−w dt): correction 1 − e^(−2 w dt), learning (1 − e^(−w dt))²/dt
plant     Φ − 1 of each part of a sample, of two lags in series and ringing
rate      r ← m r + (1 − m)/dt (x − x before),  m = e^(−2π f dt)
"""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np

from eaid.control.kinds import Law
from eaid.control.pi import PIGains
from eaid.control.pi_feedforward import PIFeedforwardGains
from eaid.control.rc import RCGains
from eaid.errors import UsageError
from eaid.logs.units import UNKNOWN
from eaid.plant.dynamics import Plant, in_samples, plant_numbers, plant_terms
from eaid.plant.operating import around
from eaid.replay.controllers import DUTY_TOLERANCE_PCT, OBSERVER_PER_S

Precision = Literal["double", "single"]
# P of 1 − e^(−x) = x P(x) on 0…1, lowest power first: Taylor's series in Chebyshev polynomials of 2x − 1, cut after the
# 13th or 6th
SERIES: dict[Precision, tuple[float, ...]] = {
    "double": (
        1.0, -0.5, 0.16666666666666657, -0.04166666666666428, 0.008333333333301267, -0.0013888888886311973,
        0.00019841269707000008, -2.4801582547234134e-05, 2.755720169804312e-06, -2.7555266954791067e-07,
        2.502684445743284e-08, -2.066139635495516e-09, 1.4838225325665164e-10, -7.2247884038067735e-12,
    ),
    "single": (
        0.9999999979889346, -0.4999998012069866, 0.1666634490024249, -0.041647044298979564, 0.008275879694584938,
        -0.001301107315188573, 0.00012918686680724904,
    ),
}  # fmt: skip
LARGEST_CONSTANT: dict[Precision, float] = {"double": 1e60, "single": 1e15}  # Constant: its square is a number still
LONGEST_DELAY = 10_000  # Samples of dead time that an exported plant holds
WHOLE_SAMPLES = 1e-9  # Part of a sample by which a dead time may miss whole ones
SEARCHES = 16  # Tries of the inverse's search at most: twelve are the most seen
# The search ends when it moves the duty by no more than that
TOLERANCE = {"double": DUTY_TOLERANCE_PCT, "single": 1e-4}


def hexadecimal(value: Any) -> str:
    """A C99 hex float, exact: float for a numpy.float32, double for a float; integers as unsigned."""
    if isinstance(value, int):
        return f"{value}U"
    suffix = "F" if isinstance(value, np.float32) else ""
    number = float(value)
    if math.isnan(number):
        return "EAID_NAN"
    if math.isinf(number):
        return "EAID_INF" if number > 0 else "-EAID_INF"
    return number.hex() + suffix


def decimal(value: Any) -> str:
    """The shortest decimal that gives the number back, always with a point: YAML and C both take it for a real one."""
    if isinstance(value, int):
        return str(value)
    number = float(value)
    text = str(value) if isinstance(value, np.float32) else repr(number)
    if not math.isfinite(number):
        return {"nan": "NaN", "inf": "Inf", "-inf": "-Inf"}[text]
    mantissa, mark, exponent = text.partition("e")
    return f"{mantissa if '.' in mantissa else mantissa + '.0'}{mark}{exponent}"


def commented(lines: list[str], before: str) -> str:
    """The head's lines behind a comment mark; nothing in them can end the comment."""
    return "\n".join((before + in_comment(line)).rstrip() for line in lines)


def in_comment(text: str) -> str:
    """A text of one line that ends no comment and goes on to no next line, whatever a file or a unit is called."""
    return " ".join(text.split()).replace("*/", "* /").replace("/*", "/ *").rstrip("\\ ")


def unit_name(text: str) -> str:
    """A unit as any language may hold it: one short word, no quotes."""
    return in_comment(re.sub(r"[\"'\\{}<>]", "", text))[:20] or UNKNOWN


@dataclass(frozen=True)
class Entry:
    """One constant; a model inside a law is an entry whose value holds those of the model."""

    name: str
    value: Any
    unit: str = ""
    words: str = ""

    @property
    def comment(self) -> str:
        """Meaning and unit, as a comment has them."""
        return " ".join(part for part in (self.words, self.unit and f"[{self.unit}]") if part)


Entries = tuple[Entry, ...]


def rounded(value: Any, precision: Precision) -> Any:
    """A number, entries or a series as the target holds them: floats stay, or become numpy.float32."""
    if isinstance(value, tuple):
        return tuple(rounded(item, precision) for item in value)
    if isinstance(value, Entry):
        return replace(value, value=rounded(value.value, precision))
    return np.float32(value) if precision == "single" and isinstance(value, float) else value


def namespace(entries: Entries, series: tuple[Any, ...]) -> SimpleNamespace:
    """Constants as `eaid.export.reference` reads them."""
    inner = {e.name: namespace(e.value, series) if isinstance(e.value, tuple) else e.value for e in entries}
    return SimpleNamespace(**inner, series=series)


@dataclass(frozen=True)
class RigInfo:
    """What every law needs to know of the rig beside its gains."""

    dt_s: float
    precision: Precision
    duty_on_fault: float  # Duty while an input is no number, or the state was not made ready
    input: str  # Units
    output: str

    @property
    def rate_filter_hz(self) -> float:
        """Corner of the reference's filtered derivative [Hz]: 25, a tenth of a lower rate."""
        return min(25.0, 0.1 / self.dt_s)

    def dead_time(self, plant: Plant) -> tuple[int, float, float]:
        """Whole samples until a duty acts, and the parts of a sample [s] before and after it does."""
        whole, part = in_samples(plant.dead_time_s, self.dt_s)
        part = part if part > WHOLE_SAMPLES else 0.0
        return whole, part * self.dt_s, (1 - part) * self.dt_s

    def per(self, unit: str) -> str:
        """A unit below a slash, in brackets where it is a compound one."""
        return f"/({unit})" if "·" in unit else f"/{unit}"

    def limits(self, low: float, high: float) -> Entries:
        """What all controllers hold."""
        i = self.input
        return (
            Entry("duty_min", low, i, "lowest duty of the actuator"),
            Entry("duty_max", high, i, "highest duty of the actuator"),
            Entry("duty_on_fault", self.duty_on_fault, i, "given while an input is no number; yours to change"),
            Entry("dt", self.dt_s, "s", "sample time"),
        )


def pi_constants(gains: PIGains | PIFeedforwardGains, rig: RigInfo) -> Entries:
    """Constants of the PI."""
    i, o = rig.input, rig.output
    return (
        Entry("K_P", gains.K_P, i + rig.per(o), "proportional gain"),
        Entry("K_I", gains.K_I, f"{i}/({o}·s)", "integral gain"),
        *rig.limits(gains.duty_min, gains.duty_max),
    )


def pi_feedforward_constants(gains: PIFeedforwardGains, rig: RigInfo) -> Entries:
    """Constants of the PI with the robust controller's feedforward."""
    K_P, K_I, *limits = pi_constants(gains, rig)
    return (K_P, K_I, *forward_constants(gains, rig), *limits)


def forward_constants(gains: PIFeedforwardGains | RCGains, rig: RigInfo) -> Entries:
    """Constants of what is fed forward: B̂, and the linear model."""
    i, o = rig.input, rig.output
    return (
        Entry("B_hat", gains.B_hat, f"{i}·s{rig.per(o)}", "B̂, Eq. (11)"),
        Entry("a0", gains.a0, "1/s", "linear model, Eq. (8)"),
        Entry("b0", gains.b0, f"{o}/(s·{i})", "linear model"),
        Entry("c0", gains.c0, f"{o}/s", "linear model"),
    )


def rc_constants(gains: RCGains, rig: RigInfo) -> Entries:
    """Constants of the robust controller."""
    g, o = gains, rig.output
    return (
        Entry("K_P", g.K_P, "1/s²", "Eq. (12)"),
        Entry("K_D", g.K_D, "1/s", "Eq. (12)"),
        *forward_constants(gains, rig),
        Entry("rho_constant", g.rho_constant, f"{o}/s", "ρ at ξ = 0, Eq. (15)"),
        Entry("rho_slope", g.rho_slope, "1/s", "dρ/d‖ξ‖"),
        Entry("epsilon", g.epsilon, "", "half width of the boundary layer, in units of z"),
        Entry("gamma", g.gamma, "", "sharpness of the soft switch, per unit of z"),
        Entry("Q12", g.Q12, "", "z = Q12 ∫e + Q22 e"),
        Entry("Q22", g.Q22),
        Entry("at_zero", math.tanh(g.gamma * g.epsilon), "", "tanh(γε)"),
        *rig.limits(g.duty_min, g.duty_max),
    )


def plant_constants(plant: Plant, rig: RigInfo) -> Entries:
    """Constants of the plant; polynomials of the duty, lowest power first. What a kind does not have is left out."""
    p, i, o = plant_numbers(plant), rig.input, rig.output
    rows = [("", p.pieces[0], "T_s(u), Eq. (7)")]
    if p.through:
        rows = [(str(k or ""), one, f"T_s from {one[0]:g} on, of what is above") for k, one in enumerate(p.pieces)]
    equations: list[tuple[str, tuple[float, ...], str, str]]
    equations = [(f"Ts{k}", piece[1:], o, words) for k, piece, words in rows]
    begins = [Entry(f"Ts{k}_from", piece[0], i) for k, piece, _ in rows if p.through]
    if p.signed:
        equations.append(("Ts_below", p.Ts_below, o, "T_s of inputs below rest, over their size"))
    if plant.zeta is None:
        equations = [("tau1", p.tau1, "s", "τ1(u), Eq. (5)"), ("tau2", p.tau2, "s", "τ2(u), Eq. (6)"), *equations]
    powers = ("", rig.per(i), f"{rig.per(i)}²", f"{rig.per(i)}³")
    curves = (
        Entry(f"{name}_{k}", value, unit + powers[k], "" if k else words)
        for name, numbers, unit, words in equations
        for k, value in enumerate(numbers)
    )
    lags: tuple[Entry, ...] = (
        Entry("release1", p.release[0], "s", "τ1 of a fall to rest; 0: none was fitted"),
        Entry("release2", p.release[1], "s", "τ2 of a fall to rest; 0: none was fitted"),
        Entry("tau_floor", p.floor, "s", "shortest time constant"),
    )
    if plant.falls_as_release:
        lags += (
            Entry("release_below", LARGEST_CONSTANT[rig.precision], i, "inputs below it, all, have the release's τ"),
        )
    elif plant.falls != (1.0, 1.0):
        lags += tuple(Entry(f"falls{k}", p.falls[k - 1], "", f"factor on τ{k} of falls between levels") for k in (1, 2))
    if plant.zeta is not None:
        lags = (Entry("z", p.z, "", "output = x1 + z x2"), *flows(plant, rig))
    delay, before, after = rig.dead_time(plant)
    late: tuple[Entry, ...] = ()
    if plant.dead_time_s > 0:
        late = (
            Entry("delay", delay, "", "samples from a duty until it acts"),
            Entry("dt_before", before, "s", "part of a sample in which the duty before still acts"),
            Entry("dt_after", after, "s", "what is left of the sample"),
        )
    return (
        *([Entry("C", p.C, "", "share of the fast part")] if plant.zeta is None else []),
        *curves,
        *begins,
        Entry("u_low", p.u_low, i, "lowest identified duty"),
        Entry("u_high", p.u_high, i, "highest identified duty"),
        *lags,
        Entry("dt", rig.dt_s, "s", "sample time"),
        *late,
    )


def flows(plant: Plant, rig: RigInfo) -> Entries:
    """Φ − 1, by which both states move from where they rest, over each part of a sample."""
    _, before, after = rig.dead_time(plant)
    tau = plant_terms(plant_numbers(plant), plant.u_range[1])[0]
    unit = around(replace(plant, tau1=(tau,)), plant.u_range[1])
    return tuple(
        Entry(f"{name}_{row}{column}", float(change[row - 1, column - 1]), "", "Φ − 1" if row == column == 1 else "")
        for name, dt in (("before", before), ("after", after))
        for change in (unit.over(dt)[0] - np.eye(2),)
        for row in (1, 2)
        for column in (1, 2)
    )


def inverse_constants(plant: Plant, limits: tuple[float, float], rig: RigInfo) -> Entries:
    """Constants of the inverse between the duty limits."""
    gone = -math.expm1(-OBSERVER_PER_S * rig.dt_s)
    kept = 1.0 - gone
    return (
        Entry("correction", 1.0 - kept * kept, "",
              "observer: share of the innovation that corrects the model's states"),
        Entry("learning", gone * gone / rig.dt_s, "1/s", "observer: rate at which it learns what the model lacks"),
        Entry("tolerance", TOLERANCE[rig.precision], rig.input, "the search ends when it moves the duty by no more"),
        *rig.limits(*limits),
        Entry("searches", SEARCHES, "", "tries of the search at most"),
        Entry("plant", plant_constants(plant, rig), "", "the model that is inverted"),
    )  # fmt: skip


def rate_constants(rig: RigInfo) -> Entries:
    """Constants of the filtered derivative."""
    memory = math.exp(-2 * math.pi * rig.rate_filter_hz * rig.dt_s)
    return Entry("memory", memory), Entry("gain", (1.0 - memory) / rig.dt_s, "1/s")


# Law of a file of gains → its constants
CONSTANTS: dict[str, Callable[[Any, RigInfo], Entries]] = {
    "pi": pi_constants, "rc": rc_constants, "pi-feedforward": pi_feedforward_constants,
}  # fmt: skip


def name_in_code(law: str) -> str:
    """A law as identifiers have it."""
    return law.replace("-", "_")


def constants_of(
    loops: Mapping[str, Law], plant: Plant | None, limits: tuple[float, float], laws: tuple[str, ...], rig: RigInfo
) -> dict[str, Entries]:
    """Constants of each law, and of the rate's filter, in the target's precision; UsageError where one is too large."""
    made = {name_in_code(name): CONSTANTS[name](law, rig) for name, law in loops.items() if name in laws}
    if plant is not None:
        if "inverse" in laws:
            made["inverse"] = inverse_constants(plant, limits, rig)
        if "plant" in laws:
            made["plant"] = plant_constants(plant, rig)
            delay = rig.dead_time(plant)[0]
            if delay > LONGEST_DELAY:
                raise UsageError(
                    f"«law» plant: its dead time of {plant.dead_time_s:.4g} s takes {delay} samples at "
                    f"{1 / rig.dt_s:.6g} Hz, {LONGEST_DELAY} at most; lower «rate_hz»"
                )
    if set(laws) - {"plant"}:
        made["rate"] = rate_constants(rig)
    for law, entries in made.items():
        inner = [one for entry in entries if isinstance(entry.value, tuple) for one in entry.value]
        for entry in (one for one in (*entries, *inner) if not isinstance(one.value, tuple)):
            if not abs(entry.value) <= LARGEST_CONSTANT[rig.precision]:
                raise UsageError(
                    f"{law}: {entry.name} is {entry.value:g}, which {rig.precision} precision cannot hold safely; "
                    "export others"
                )
    return {name: rounded(entries, rig.precision) for name, entries in made.items()}
