"""The plant, and how it goes from one instant to the next while its input is held: exactly, for any time.

Two states x with one matrix serve every kind; θ later than the input changes, with w = T_s(u),

    x' = A(u) (x − e w),   y = idle + x1 + z x2

    one lag, two in parallel (Eqs. (4)-(7))    A = −diag(1/τ1, 1/τ2),              e = (C, 1 − C),  z = 1
    two in series, ringing                     A = ω [[0, 1], [−1, −2ζ]],          e = (1, 0),      z: of a zero, else 0

One lag has C = 1; C > 1 is an overshoot. In series ζ ≥ 1 and τ1,2 = (ζ ∓ √(ζ² − 1))/ω; below 1 the plant rings.
Two lags with a zero are two in parallel with C = (z/ω − τ1)/(τ2 − τ1).

Where w falls its parts may have other time constants (of an overshoot the slow one then rises). Release constants hold
for falls to rest: towards an input u below u_low a part has τ = s τ(u_low) + (1 − s) τ_release, s = u/u_low, the line
that T_s follows there; at rest behind a held input τ of that one, where the logs show it (`release_as_left`). Falls
towards an identified input have τ(u) times a factor, or the release's constants too (`falls_as_release`). Where the
input last fell, T_s may be larger by a share (`excess`, a hysteresis).

Floors, for plants drawn from an uncertain fit: τ1 ≥ `floor_s`, τ2 ≥ τ1, T_s ≥ 0 on the side of the input.

Floats and `math` only below `PlantNumbers`: numba compiles those functions as they stand.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.plant.forms import (
    KnownPoints,
    LegendreForm,
    Pieces,
    Proportional,
    Range,
    above_rest,
    cubic,
    curve,
    pieces_through,
    piecewise,
)

Powers = tuple[float, ...]  # A polynomial of the input, lowest power first
SHARE = 0.85  # C: share of the fast part, held at the paper's value unless the user sets or frees it
TAU_FLOOR_S = 1e-3  # Least τ1 of a fit and of a replay [s], specification 3
CHECKED_INPUTS = 101  # Equally spaced inputs, over the identified range, at which the constraints of a fit hold


@dataclass(frozen=True)
class Plant:
    """A clutch, or any rig with two states; inputs and outputs in the rig's own units, counted from rest."""

    tau1: Powers  # τ1(u) [s], polynomial of |u|, lowest power first; of series and ringing 1/ω
    tau2: Powers  # τ2(u) [s]; of one lag anything: nothing feels it
    Ts: Powers  # T_s(u), polynomial of u above rest
    u_range: Range  # Lowest and highest identified input, by size
    C: float = SHARE  # Share of the fast part: 1 of one lag, above 1 of an overshoot
    release: tuple[float, float] | None = None  # (τ1, τ2) of falls to rest [s], where those were fitted
    release_as_left: bool = False  # Falls of a held input to rest have those of the input that was left
    falls_as_release: bool = False  # Falls between identified inputs have them too
    falls: tuple[float, float] = (1.0, 1.0)  # Factors on τ1 and τ2 of falls between identified inputs
    excess: float = 0.0  # Share by which T_s is larger where the input last fell
    zeta: float | None = None  # ζ; None: one lag, or two in parallel
    zero: float = 0.0  # z of series and ringing
    Ts_below: Powers = ()  # T_s of an input below rest, polynomial of |u|; empty: the input has one sign
    Ts_through: KnownPoints = ()  # Values that T_s(u) goes through, in place of its polynomial
    dead_time_s: float = 0.0  # θ [s]
    idle: float = 0.0  # Output at rest
    floor_s: float = TAU_FLOOR_S  # Least time constant [s]: 1 ms, less where the logs are sampled faster

    @property
    def kind(self) -> str:
        """lag | parallel | overshoot | series | ringing."""
        if self.zeta is not None:
            return "series" if self.zeta >= 1 else "ringing"
        return "lag" if self.C == 1 else "overshoot" if self.C > 1 else "parallel"

    def steady(self, u: Array | float) -> Array:
        """T_s(u), shape of `u`: a line to 0 below the identified inputs, constant above; of one sign 0 at least."""
        part = above_rest(self.size(u), self.u_range)
        found = self.curve(u) * part
        return found if self.signed else np.maximum(found, 0.0)

    def curve(self, u: Array | float, order: int = 0) -> Array:
        """T_s(u) as its form has it over the identified inputs, or its derivative by the input's size, shape of `u`."""
        size = self.size(u)
        found = piecewise(self.pieces, size, self.u_range, order)
        if not self.signed:
            return found
        return np.where(np.asarray(u) < 0, piecewise(self.pieces_below, size, self.u_range, order), found)

    def slope(self, u: float) -> float:
        """dT_s/du where an input is held: that of the line to rest below the identified ones, beyond them as at the
        largest."""
        side, size = (-1.0 if self.signed and u < 0 else 1.0), float(self.size(u))
        if size < self.u_range[0]:
            return side * float(self.curve(side * self.u_range[0])) / self.u_range[0]
        return side * float(self.curve(u, 1))

    @cached_property
    def pieces(self) -> Pieces:
        """T_s(u) of inputs above rest."""
        return pieces_through(self.Ts_through) if self.Ts_through else (cubic("Ts", self.Ts),)

    @cached_property
    def pieces_below(self) -> Pieces:
        """T_s(u) of inputs below rest, over their size."""
        return (cubic("Ts_below", self.Ts_below),)

    @property
    def signed(self) -> bool:
        """Whether the input goes below rest, too."""
        return bool(self.Ts_below)

    @property
    def gain(self) -> Proportional | LegendreForm:
        """The form of a polynomial T_s(u), linear in its coefficients."""
        degree = max((k for k, c in enumerate(self.Ts) if c), default=0)
        through_rest = degree > 0 and self.Ts[0] == 0
        return Proportional(*self.u_range, degree) if through_rest else LegendreForm(degree, *self.u_range)

    @property
    def sloped(self) -> bool:
        """Whether T_s goes with the input: a single level tells no slope."""
        return any(any(piece[2:]) for piece in self.pieces)

    @property
    def steady_numbers(self) -> Powers:
        """The numbers that T_s(u) of inputs above rest rests on: coefficients, or values that it goes through."""
        return tuple(value for _, value in self.Ts_through) or self.Ts

    def moved(self, tau1: Powers, tau2: Powers, Ts: Powers, C: float) -> Self:
        """The same with other polynomials; a T_s that goes through values goes with its polynomial."""
        found = replace(self, tau1=tau1, tau2=tau2, Ts=Ts, C=C)
        if not self.Ts_through:
            return found
        u, values = np.array(self.Ts_through).T
        before, after = (curve(one.Ts, u, self.u_range) for one in (self, found))
        ratio = np.divide(after, before, out=np.ones_like(u), where=before > 0)
        return replace(found, Ts_through=tuple(zip(u.tolist(), (values * ratio).tolist(), strict=True)))

    def scaled(self, gain: float) -> Self:
        """The same with a T_s so many times larger."""
        return replace(
            self, Ts=tuple(gain * c for c in self.Ts), Ts_below=tuple(gain * c for c in self.Ts_below),
            Ts_through=tuple((u, gain * value) for u, value in self.Ts_through),
        )  # fmt: skip

    def times(self, factors: Mapping[str, float]) -> Self:
        """The same with numbers so many times larger, by their names in results; τ1 and τ2 as a rising output has
        them."""
        one = factors.get("tau1", 1.0)
        two, zeta = factors.get("tau2", one), self.zeta
        if zeta is not None:  # the root of τ2/τ1 is a = ζ + √(ζ² − 1), where these are real
            apart = (zeta + math.sqrt(max(zeta**2 - 1, 0.0))) * math.sqrt(two / one)
            zeta = 0.5 * (apart + 1 / apart) if zeta >= 1 else zeta * factors.get("zeta", 1.0)
            one = two = math.sqrt(one * two) / factors.get("omega", 1.0)
        tau1, tau2 = (tuple(factor * c for c in powers) for factor, powers in ((one, self.tau1), (two, self.tau2)))
        share, dead_time_s = self.C * factors.get("C", 1.0), self.dead_time_s * factors.get("dead_time_s", 1.0)
        found = self.scaled(factors.get("gain", 1.0))
        return replace(found, tau1=tau1, tau2=tau2, C=share, zeta=zeta, dead_time_s=dead_time_s)

    def size(self, u: Array | float) -> Array | float:
        """What the curves run over: the input, or its size where it goes below rest, too."""
        return np.abs(u) if self.signed else u

    def time_constants(self, u: Array | float) -> tuple[Array, Array]:
        """τ1 and τ2 [s] as a rising output has them, shape of `u`; of ringing both are 1/ω."""
        tau1 = curve(self.tau1, self.size(u), self.u_range)
        if self.zeta is None:
            return tau1, curve(self.tau2, self.size(u), self.u_range)
        root = math.sqrt(max(self.zeta**2 - 1, 0.0))
        apart = (self.zeta + root) if self.zeta >= 1 else 1.0
        return tau1 / apart, tau1 * apart

    def slowest_s(self, u: Array | float) -> float:
        """The longest time in which a transient falls to 1/e, at some inputs [s]."""
        if self.kind == "lag":
            return float(np.max(self.time_constants(u)[0]))
        if self.kind == "ringing":
            return float(np.max(curve(self.tau1, self.size(u), self.u_range))) / max(self.zeta or 0.0, 1e-3)
        return float(np.max(self.time_constants(u)[1]))

    def to_control(self, at: float, pade: int = 0) -> Any:
        """The plant around a held input as python-control's `StateSpace`; its dead time by Padé of that order."""
        from eaid.plant.operating import around

        return around(self, at).to_control(pade)

    def at(self, u: float) -> "Step":
        """The step from rest to an input; of one lag or two in parallel."""
        tau1, tau2 = (float(one) for one in self.time_constants(u))
        tau1 = max(tau1, self.floor_s)
        return Step(self.steady(u).item(), tau1, max(tau2, tau1), self.C)


@dataclass(frozen=True)
class Step:
    """Eq. (3): T(t) = (C (1 − e^(−t/τ1)) + (1 − C)(1 − e^(−t/τ2))) T_s, the plant while one input is held."""

    Ts: float  # Steady output
    tau1: float  # Fast time constant [s]
    tau2: float  # Slow time constant [s]
    C: float = SHARE


# Specification 6: Table III's time constants, and a T_s(u) that gives back the paper's linear model. Synthetic.
REFERENCE_PLANT = Plant(
    tau1=(6.74e-3, 2.39e-2, -2.13e-4),
    tau2=(0.93, 0.41, -2.64e-3),
    Ts=(0.032, 9.2e-3, 2.1e-4, 1.32e-6),
    u_range=(10.0, 100.0),
)


def in_samples(time_s: float, step_s: float) -> tuple[int, float]:
    """A dead time as whole samples and the part of one that is left."""
    whole = int(time_s / step_s + 1e-9)
    return whole, max(time_s / step_s - whole, 0.0)


class PlantNumbers(NamedTuple):
    """A `Plant` as the loops take it, floats throughout; polynomials of the input's size, lowest power first."""

    C: float
    tau1: tuple[float, float, float]
    tau2: tuple[float, float, float]
    Ts: tuple[float, float, float, float]
    u_low: float  # Lowest identified input, by size
    u_high: float  # Highest
    release: tuple[float, float]  # (τ1, τ2) of a fall to rest [s]; 0: no release was fitted
    release_below: float  # Input below which a fall goes over to them; infinite: every fall has them
    Ts_below: tuple[float, float, float, float]  # T_s of inputs below rest
    falls: tuple[float, float]  # Factors on τ1 and τ2 of falls between identified inputs
    zeta: float  # Below 0: one lag, or two in parallel
    z: float  # y = x1 + z x2
    floor: float  # Least time constant [s]
    signed: bool  # Whether the input goes below rest, too
    late_s: float = 0.0  # Dead time [s]
    release_as_left: bool = False  # Whether falls of a held input to rest have the τ of the input that was left
    through: bool = False  # Whether T_s of inputs above rest is a row of cubics, and not one
    pieces: Pieces = ((0.0, 0.0, 0.0, 0.0, 0.0),)


def plant_numbers(p: Plant) -> PlantNumbers:
    """The form of a plant that loops take, polynomials filled up with zeros; DataError where one has more coefficients
    than Eqs. (5)-(7)."""
    filled: list[Any] = []  # tuples of three
    for name in ("tau1", "tau2"):
        polynomial = getattr(p, name)
        if not 1 <= len(polynomial) <= 3:
            raise DataError(f"nonlinear.{name} has {len(polynomial)} coefficients; the replay takes 1 to 3")
        filled.append((*map(float, polynomial), 0.0, 0.0)[:3])
    tau1, tau2 = filled
    low, high = map(float, p.u_range)
    fast, slow = map(float, p.release or (0.0, 0.0))
    until, parallel = math.inf if p.falls_as_release else low, p.zeta is None
    return PlantNumbers(
        float(p.C), tau1, tau2, p.pieces[0][1:], low, high, (fast, slow), until, p.pieces_below[0][1:],
        (float(p.falls[0]), float(p.falls[1])),
        -1.0 if p.zeta is None else float(p.zeta), 1.0 if parallel else float(p.zero), float(p.floor_s),
        p.signed, float(p.dead_time_s), p.release_as_left, bool(p.Ts_through), p.pieces,
    )  # fmt: skip


def steady_piece(pieces: Pieces, u: float) -> float:
    """A row of cubics at an input."""
    begin, c0, c1, c2, c3 = pieces[0]
    for k in range(1, len(pieces)):
        if u >= pieces[k][0]:
            begin, c0, c1, c2, c3 = pieces[k]
    v = u - begin
    return c0 + v * (c1 + v * (c2 + v * c3))


def plant_terms(plant: PlantNumbers, u: float) -> tuple[float, float, float]:
    """τ1 [s], τ2 [s] and T_s at an input, as a rising output has them."""
    a0, a1, a2 = plant.tau1
    b0, b1, b2 = plant.tau2
    c0, c1, c2, c3 = plant.Ts
    low, high = plant.u_low, plant.u_high
    below = plant.signed and u < 0.0
    if below:
        c0, c1, c2, c3 = plant.Ts_below
        u = -u
    share = 1.0
    if u < low:
        share = u / low if u > 0.0 else 0.0
        u = low
    elif u > high:
        u = high
    tau1 = a0 + u * (a1 + u * a2)
    tau2 = b0 + u * (b1 + u * b2)
    if plant.through and not below:
        steady = share * steady_piece(plant.pieces, u)
    else:
        steady = share * (c0 + u * (c1 + u * (c2 + u * c3)))
    if tau1 < plant.floor:
        tau1 = plant.floor
    if tau2 < tau1:
        tau2 = tau1
    if steady < 0.0 and not below:
        steady = 0.0
    return tau1, tau2, steady


def plant_pull(plant: PlantNumbers, x1: float, x2: float, u: float) -> tuple[float, float, float, float]:
    """Target minus state of the fast and the slow part, and the time constant of each [s]; two lags in parallel."""
    tau1, tau2, steady = plant_terms(plant, u)
    target = plant.C * steady
    fast = target - x1
    slow = steady - target - x2
    slow_falls = slow * (1.0 - plant.C) < 0.0
    if u < plant.release_below:
        share = u / plant.release_below if u > 0.0 else 0.0
        release1, release2 = plant.release
        if fast < 0.0 and release1 > 0.0:
            tau1 = share * tau1 + (1.0 - share) * release1
        if slow_falls and release2 > 0.0:
            tau2 = share * tau2 + (1.0 - share) * release2
    else:
        if fast < 0.0:
            tau1 = tau1 * plant.falls[0]
        if slow_falls:
            tau2 = tau2 * plant.falls[1]
    return fast, slow, tau1, tau2


def plant_rest(plant: PlantNumbers, steady: float) -> tuple[float, float]:
    """The states that hold a steady output."""
    if plant.zeta >= 0.0:
        return steady, 0.0
    return plant.C * steady, (1.0 - plant.C) * steady


def swing(zeta: float, s: float) -> tuple[float, float]:
    """c and n with e^(Ms) = c I + n (M + ζ I), M = [[0, 1], [−1, −2ζ]]: e^(−ζs) times cosh and sinh/√ of √(ζ² − 1) s.

    One formula where the roots are real, equal or complex: what meets at ζ = 1 is a series there.
    """
    d = zeta * zeta - 1.0
    if abs(d) * s * s < 1e-8:
        e = math.exp(-zeta * s)
        return e * (1.0 + 0.5 * d * s * s), e * s * (1.0 + d * s * s / 6.0)
    if d < 0.0:
        root = math.sqrt(-d)
        e = math.exp(-zeta * s)
        return e * math.cos(root * s), e * math.sin(root * s) / root
    root = math.sqrt(d)
    slow = math.exp(-s / (zeta + root))
    gone = -math.expm1(-2.0 * root * s)
    return slow * (1.0 - 0.5 * gone), slow * gone / (2.0 * root)


def plant_step(plant: PlantNumbers, x1: float, x2: float, u: float, dt: float) -> tuple[float, float]:
    """The states after dt seconds of a held input; exact for any dt."""
    if plant.zeta >= 0.0:
        tau, _, steady = plant_terms(plant, u)
        c, n = swing(plant.zeta, dt / tau)
        away = x1 - steady
        return (steady + (c + plant.zeta * n) * away + n * x2, (c - plant.zeta * n) * x2 - n * away)
    fast, slow, tau1, tau2 = plant_pull(plant, x1, x2, u)
    # expm1 keeps precision when dt << tau, where 1 - exp(-x) cancels.
    return x1 - math.expm1(-dt / tau1) * fast, x2 - math.expm1(-dt / tau2) * slow
