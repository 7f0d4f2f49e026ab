"""Gain and phase margins of the loop as it really runs, sampled, behind a dead time, the duty latched by a PWM; and
which loops lack 6 dB or 45° around some level.

Around an operating point a control law is linear in the reference r, its rate v, the torque T that is read and the
integral q of the error: δu = k_r δr + k_v δv − k_T δT + k_q δq. The plant is the two states of
`eaid.plant.operating`, behind its dead time. The loop is opened at the duty.

Samples at k h and latches at j/f_pwm repeat together after a common period, taken as 100 samples at most. Over it the
loop is a linear map of the state (plant, law, latched duty, duties on their way): stable where its spectral
radius is below 1. The gain margin is the factor on the duty that brings the radius to 1: exact, aliasing included. The
phase margin is read at the crossover of the loop's frequency response, the latch by its mean response. A dead time of
more than twenty holds would make too many states, and all crossovers lie far below the rate of the latch: there the map
holds a duty for a twentieth of it, duty and integral as late on the mean.
"""

import cmath
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from eaid.arrays import Array, median
from eaid.control.kinds import LAW_KINDS, Law, row_of_gains
from eaid.control.pi import PIGains
from eaid.control.rc import RCGains
from eaid.errors import GainsError
from eaid.findings import Finding, finding
from eaid.plant import linear
from eaid.plant.dynamics import Plant
from eaid.plant.forms import RESTING
from eaid.plant.linear import LinearPlant
from eaid.plant.operating import Complex, Operating, around, lag
from eaid.results.common import Interval, ci95_of
from eaid.results.fit import Fit
from eaid.results.gains import Margin, MarginPoint, Margins, Timing
from eaid.results.models import LinearLevel, StepShape
from eaid.results.plant import falls_between

LATE = 20  # Holds of dead time that the map of a loop spans at most
MOST_DB, STEP_DB = 80.0, 2.0  # Gain margins are sought up to here, in such steps
ENOUGH_DB, ENOUGH_DEG = 6.0, 45.0
LESS_DB, LESS_DEG = 3.0, 20.0  # By which a loop's margins may be less in falls that no log shows, and nothing is said


class LinearLaw(NamedTuple):
    """A controller around a point: δu = k_r δr + k_v δv − k_T δT + k_q δq, of reference r, its rate v, the torque T
    that is read, and the integral q of the error; without k_q nothing reads the integral."""

    k_r: float
    k_v: float
    k_T: float
    k_q: float

    def over(self, h: float) -> tuple[Array, Array, Array, float]:
        """A, B, C and D of s ← A s − B T, u = C s − D T, a sample being h; s is the integral."""
        kept = 1 if self.k_q else 0
        return np.eye(kept), np.full(kept, h), np.full(kept, self.k_q), self.k_T

    def response(self, z: Complex, h: float) -> Complex:
        """Duty per torque that is read, its sign turned, at z = e^(iωh)."""
        return np.asarray(self.k_T + self.k_q * h / (z - 1), dtype=np.complex128)


class Point(NamedTuple):
    """Where a loop is linearised."""

    duty_pct: float
    torque_nm: float
    plant: Operating  # Around that input
    falling: bool = False  # With the time constants of an output that falls
    times: float = 1.0  # Factor by which the rig's gain may be larger than the plant's

    @property
    def steepest(self) -> "Point":
        """With the largest gain that the rig may have."""
        return self._replace(plant=replace(self.plant, gain=self.times * self.plant.gain))


MARGIN_POINTS = 10  # Operating points of the margins where the fit names no levels
STEEP_INPUTS = 9  # Inputs beside a level at which T_s(u) is looked at for its steepest slope


def points_of(
    fit: Fit, plant: Plant | None, model: LinearPlant, rows: Sequence[LinearLevel], limits: tuple[float, float]
) -> list[Point]:
    """Where the loops of a fit are looked at: held duties, its plant there, and how much steeper the rig may be."""
    points = as_stepped(operating_points(plant, model, rows, fit.data.levels, limits), fit.steps)
    if plant is None or not plant.sloped:
        return points
    ends = interpolate_ends(known_ends(fit), [point.duty_pct for point in points])
    scatter = (fit.nonlinear.level_scatter if fit.nonlinear is not None else None) or 0.0
    return may_be_steeper(points, plant, ends, scatter)


def known_ends(fit: Fit) -> dict[float, tuple[float, float]]:
    """T_s's interval at the inputs where the fit tells it: at levels, else at the highest input of either sign."""
    known = {row.level: own for row in fit.level_values if (own := ci95_of(row, "Ts")) is not None}
    if known or fit.plant_ is None or (held := fit.plant_.ci95) is None:
        return known
    if rows := held.levels.get("Ts"):
        return {u: (low, high) for u, low, high in rows}
    top = fit.plant_.u_range[1]
    gains = {top: held.gain, -top: held.gain_below}
    return {u: (abs(u) * own[0], abs(u) * own[1]) for u, own in gains.items() if own is not None}


def interpolate_ends(known: Mapping[float, tuple[float, float]], inputs: Sequence[float]) -> dict[float, Interval]:
    """Intervals at some inputs, between two that are known by lines through their ends; None beyond them."""
    if not known:
        return {}
    at = sorted(known)
    ends = [np.interp(inputs, at, [known[u][k] for u in at]).tolist() for k in (0, 1)]
    return {u: (low, high) for u, low, high in zip(inputs, *ends, strict=True) if at[0] <= u <= at[-1]}


def operating_points(
    plant: Plant | None,
    model: LinearPlant,
    rows: Sequence[LinearLevel],
    levels: Sequence[float],
    limits: tuple[float, float],
) -> list[Point]:
    """Held duties over the identified range; without a nonlinear model, or where one level gave T_s no slope, the
    first-order models of the levels, else the pooled one in the middle of the actuator's range."""
    if plant is not None and plant.sloped:
        low, high = plant.u_range
        duties = [u for u in levels if low <= u <= high] or np.linspace(low, high, MARGIN_POINTS).tolist()
        rests = RESTING * float(np.max(plant.steady(np.array(duties))))  # a loop holds no output there
        duties = [u for u in duties if plant.slope(u) > 0 or plant.steady(u) > rests]
        duties = [*(-u for u in reversed(duties) if plant.signed), *duties]
        down = falling(plant)
        ways = [(False, plant)] + ([(True, down)] if down is not None else [])
        return [Point(u, float(plant.steady(u)), around(way, u), falls) for falls, way in ways for u in duties]
    if rows:
        return [Point(row.level, row.gain, lag(row.gain / row.level, 1 / row.a0)) for row in rows]
    middle = sum(limits) / 2
    return [Point(middle, linear.steady(model, middle), lag(model.b0 / model.a0, 1 / model.a0))]


def may_be_steeper(
    points: Sequence[Point], plant: Plant, ends: Mapping[float, Interval], scatter: float
) -> list[Point]:
    """Points with how much larger the rig's gain may be than T_s(u) has it: at its steepest between the levels on both
    sides, or as the parabola through both and this one, rest among them; and by how far T_s may lie above the curve, by
    the upper one of its `ends` at that level and twice the `scatter` of levels, a part of T_s.

    Where T_s(u) falls, but no level lies below a lower one by more than their `ends`, the gain is that itself, and at
    least what these allow from the level before.
    """
    inputs, found = sorted({0.0, *(point.duty_pct for point in points)}), []
    for point in points:
        u, gain, own = point.duty_pct, point.plant.gain, ends.get(point.duty_pct)
        lower = [each for v in inputs if v < u and (each := ends.get(v)) is not None]
        if gain <= 0 and (own is None or any(low > own[1] for low, _ in lower)):
            found.append(point)
            continue
        place = inputs.index(u)
        beside = np.array(inputs[max(place - 1, 0) : place + 2])
        chords = np.diff(plant.steady(beside)) / np.diff(beside)
        parabola = float(np.interp(u, beside[[0, -1]], chords[[0, -1]]))
        least = plant.u_range[0]
        span = (max(beside[0], least), beside[-1]) if u > 0 else (beside[0], min(beside[-1], -least))
        between = np.linspace(*span, STEEP_INPUTS).tolist()
        beyond = 1.0 if own is None or not point.torque_nm else max(1.0, own[1] / point.torque_nm)
        steepest = max(gain, parabola, *map(plant.slope, between)) * (beyond + 2 * scatter)
        if gain > 0:
            found.append(point._replace(times=steepest / gain))
        else:
            before = [(v, each[0]) for v in inputs if v < u and (each := ends.get(v)) is not None]
            if own is not None and before:
                steepest = max(steepest, (own[1] - before[-1][1]) / (u - before[-1][0]))
            found.append(point._replace(plant=replace(point.plant, gain=steepest)))
    return found


def falling(plant: Plant) -> Plant | None:
    """A plant whose output always falls, where falls between levels have time constants of their own; else None."""
    if plant.zeta is not None:
        return None
    if plant.falls_as_release and plant.release is not None:
        fast, slow = plant.release
        return replace(plant, tau1=(fast,), tau2=(slow,))
    if plant.falls == (1.0, 1.0):
        return None
    tau1, tau2 = (tuple(f * c for c in tau) for f, tau in zip(plant.falls, (plant.tau1, plant.tau2), strict=True))
    return replace(plant, tau1=tau1, tau2=tau2)


def as_stepped(points: Sequence[Point], steps: Sequence[StepShape]) -> list[Point]:
    """Points with the lags of the single steps from rest to that input, where most of those overshoot: the curves of
    all levels, whose C is at most 1, show no overshoot."""
    found = []
    for point in points:
        own = [one for one in steps if one.edge == "up" and one.from_ == 0 and one.level == point.duty_pct]
        over = [one for one in own if one.C > 1 and one.tau2 is not None]
        if 2 * len(over) > len(own) and point.plant.zeta is None:
            tau1, tau2, C = (median([getattr(one, key) for one in over]) for key in ("tau1", "tau2", "C"))
            point = point._replace(plant=replace(point.plant, tau1=tau1, tau2=tau2, C=C))
        found.append(point)
    return found


def law_around(gains: Law, torque_nm: float, duty_pct: float) -> tuple[Any, float]:
    """A controller that holds a torque [N·m] with a duty [%], its limits left out, and its integral there [N·m·s].

    The PI is linear as it stands. Of any other, by central differences of its step: at rest e = 0 and the integral
    stands where the law gives that duty; far from the middle of the robust controller's layer the slope differs.
    """
    kind = row_of_gains(gains)
    if kind.around is not None:
        return kind.around(gains), 0.0
    if isinstance(gains, PIGains):
        return LinearLaw(gains.K_P, 0.0, gains.K_P, gains.K_I), duty_pct / gains.K_I if gains.K_I else 0.0
    free, step = gains._replace(duty_min=-math.inf, duty_max=math.inf), 1e-6
    if isinstance(gains, RCGains):
        step *= gains.epsilon / gains.Q22

    def given(integral: float, reference_nm: float, read_nm: float) -> float:
        return kind.step(free, integral, reference_nm, 0.0, read_nm, 0.0)[1]

    def short(integral: float) -> float:
        return given(integral, torque_nm, torque_nm) - duty_pct

    reach = 1.0
    while short(-reach) > 0 or short(reach) < 0:
        reach *= 2
    rest = float(brentq(short, -reach, reach, xtol=1e-15))

    def slope(integral: float, reference: float, torque: float) -> float:
        above, below = (
            given(rest + h * integral, torque_nm + h * reference, torque_nm + h * torque) for h in (step, -step)
        )
        return (above - below) / (2 * step)

    return LinearLaw(slope(0, 1, 0), getattr(gains, "B_hat", 0.0), -slope(0, 0, 1), slope(1, 0, 0)), rest


def enough(margin: Margin) -> bool:
    """Whether a loop has 6 dB and 45°."""
    gain_db, phase_deg = (math.inf if each is None else each for each in (margin.gain_db, margin.phase_deg))
    return bool(margin.stable) and gain_db >= ENOUGH_DB and phase_deg >= ENOUGH_DEG


def holds(gains: Law, point: Point, timing: Timing, least_db: float = ENOUGH_DB, least_deg: float = ENOUGH_DEG) -> bool:
    """Whether a loop has so much margin around an operating point, which a search for a design asks of many: `margins`
    without how much it has."""
    (law, _), plant = law_around(gains, point.torque_nm, point.duty_pct), point.plant
    for db in (least_db, *np.arange(0.0, least_db, STEP_DB).tolist()):
        if spectral_radius(law, plant, timing, 10 ** (db / 20)) >= 1:
            return False
    return min(crossovers(law, plant, timing), default=(math.inf, 0.0))[0] >= math.radians(least_deg)


@lru_cache(maxsize=100)  # the loop that a design settles on is among those it tried
def margins(gains: Law, point: Point, timing: Timing) -> Margin:
    """Gain and phase margin of a controller around an operating point, the least where there are several. None for a
    margin without end (no factor up to 80 dB makes the loop unstable, its gain stays below 1), and for the gain margin
    of a loop that is unstable."""
    (law, _), plant = law_around(gains, point.torque_nm, point.duty_pct), point.plant
    phase, omega = min(crossovers(law, plant, timing), default=(math.inf, 0.0))
    stable = spectral_radius(law, plant, timing) < 1
    gain_db = gain_margin(law, plant, timing) if stable else math.inf
    return Margin(stable, finite(gain_db), finite(math.degrees(phase)), omega / (2 * math.pi))


def finite(value: float | None) -> float | None:
    """A number that is finite; None elsewhere."""
    return value if value is not None and math.isfinite(value) else None


def least_margins(law: Law, points: Sequence[Point], timing: Timing) -> Margin:
    """The least of each margin of a loop over all operating points; not stable where it is not around any."""
    each = [margins(law, point, timing) for point in points]
    least = [
        min((margin for one in each if (margin := getattr(one, key)) is not None), default=None)
        for key in ("gain_db", "phase_deg")
    ]
    return Margin(all(one.stable for one in each), *least)


def margins_of(
    loops: Mapping[str, Law], points: Sequence[Point], timing: Timing, unit: str
) -> tuple[Margins, list[Finding]]:
    """Margins of every loop around every operating point; GainsError where one is unstable around any."""
    every = {name: [margins(gains, point, timing) for point in points] for name, gains in loops.items()}
    missed, worst = [], {}
    for name, each in every.items():
        unstable = [f"{point.duty_pct:.4g}" for point, one in zip(points, each, strict=True) if not one.stable]
        if unstable:
            raise GainsError(
                f"the {name.upper()} loop is unstable on the fitted model around {', '.join(unstable)} {unit}, "
                f"{timing.words()}; ask for slower gains"
            )
        worst[name] = least_margins(loops[name], points, timing)
        lacking = [point.duty_pct for point, one in zip(points, each, strict=True) if not enough(one)]
        if lacking and LAW_KINDS[name].design is None:  # others have enough, or RC's own
            missed.append(
                finding("margin-missed", name, lacking, unit=unit, enough_db=ENOUGH_DB, enough_deg=ENOUGH_DEG,
                        gain_db=worst[name].gain_db, phase_deg=worst[name].phase_deg)
            )  # fmt: skip
    rows = [
        MarginPoint(point.duty_pct, point.torque_nm, dict(zip(every, each, strict=True)), point.falling)
        for point, *each in zip(points, *every.values(), strict=True)
    ]
    return Margins(timing, tuple(rows), worst), missed


def supposed_falls(fit: Fit, plant: Plant | None, points: Sequence[Point]) -> list[Point]:
    """The same points with falls as quick as those to rest, where these are known and no log shows falls between
    levels; none elsewhere."""
    tested = () if fit.recorded is None else fit.recorded.falls
    seen = any(one.name == "fall_tau1" for one in tested) or bool(falls_between(fit.friction_levels))
    if seen or plant is None or plant.release is None or falling(plant) is not None:
        return []
    quick = falling(replace(plant, falls_as_release=True))
    return [] if quick is None else [one._replace(plant=around(quick, one.duty_pct), falling=True) for one in points]


def less_in_falls(
    loops: Mapping[str, Law], falls: Sequence[Point], timing: Timing, known: Mapping[str, Margin]
) -> list[Finding]:
    """Loops that lack 6 dB or 45°, or have far less than is `known`, if falls between levels are as is supposed."""
    found = []
    for name, law in loops.items() if falls else ():
        one, other = least_margins(law, falls, timing), known[name]
        less = _lies_below(one.gain_db, other.gain_db, LESS_DB) or _lies_below(one.phase_deg, other.phase_deg, LESS_DEG)
        code = "margin-less-in-falls" if enough(one) else "margin-if-falls-are-releases"
        if less or not enough(one):
            found.append(finding(code, name, gain_db=one.gain_db, phase_deg=one.phase_deg, stable=one.stable))
    return found


def _lies_below(one: float | None, other: float | None, least: float) -> bool:
    """Whether a margin lies so far below another, None being one without end."""
    return one is not None and (other is None or one < other - least)


def gain_margin(law: Any, plant: Operating, timing: Timing) -> float:
    """The factor on the duty at which the radius reaches 1 [dB]: steps to bracket it, then Brent; else infinite."""

    def over(db: float) -> float:
        return spectral_radius(law, plant, timing, 10 ** (db / 20)) - 1

    low, high = 0.0, STEP_DB
    while over(high) < 0:
        low, high = high, high + STEP_DB
        if low >= MOST_DB:
            return math.inf
    return float(brentq(over, low, high, xtol=1e-9 * high))


def spectral_radius(law: Any, plant: Operating, timing: Timing, factor: float = 1.0) -> float:
    """Spectral radius of the loop's map over one common period of sampling and latching, the duty times `factor`: below
    1 the loop dies out."""
    if timing.delay_s > LATE * timing.hold_s * (1 + 1e-9):
        quick, timing = timing, Timing((LATE + 0.5) / (timing.delay_s + timing.hold_s / 2), None, LATE)
        if isinstance(law, LinearLaw):
            law = law._replace(k_T=law.k_T + law.k_q * (timing.step_s - quick.step_s) / 2)
    samples, latches = timing.pattern
    h, hold, delay_s = timing.step_s, timing.hold_s, timing.delay_s
    late = int(delay_s / hold + 1e-9)  # whole holds that the delay spans
    rest = max(delay_s - late * hold, 0.0)
    A, B, C, D = law.over(h)
    states = 2, len(B), late + 1
    x, s, duties = np.split(np.eye(sum(states)), np.cumsum(states)[:-1])
    latched = {-1 - k: row for k, row in enumerate(duties)}
    latest, acting = latched[-1], latched[-1 - late]
    # (time, order, index): a sample comes before a latch at the same instant, a latch before the plant sees it.
    events = [(k * h, 0, k) for k in range(samples)] + [(j * hold, 1, j) for j in range(latches)]
    events += [(j * hold + rest, 2, j - late) for j in range(latches)]
    now = 0.0
    for time, order, index in [*sorted(events, key=lambda event: (round(event[0], 12), event[1])), (samples * h, 3, 0)]:
        if time > now + 1e-12:
            flow, pushed = plant.over(time - now)
            x = flow @ x + np.outer(pushed, acting)
            now = time
        if order == 0:
            torque = plant.c @ x
            latest = factor * (C @ s - D * torque)
            s = A @ s - np.outer(B, torque)
        elif order == 1:
            latched[index] = latest
        elif order == 2:
            acting = latched[index]
    after = [x, s, *(latched[latches - 1 - k][None] for k in range(late + 1))]
    return float(np.abs(np.linalg.eigvals(np.concatenate(after))).max())


def latch_response(timing: Timing, omega: Array) -> Complex:
    """Mean response of the PWM's latch over that of the plain hold at the control rate: 1 where there is no latch."""
    latches, h, hold = timing.pattern[1], timing.step_s, timing.hold_s
    # Latch j holds the duty of sample ⌊j hold/h⌋; its age is what the sum carries.
    ages = [j * hold - math.floor(j * hold / h + 1e-9) * h for j in range(latches)]
    mean = np.mean([np.exp(-1j * omega * age) for age in ages], axis=0)
    return np.asarray(mean * hold_response(omega, hold) / hold_response(omega, h), dtype=np.complex128)


def hold_response(omega: Array, hold_s: float) -> Complex:
    """Response of a zero-order hold of unit gain."""
    return np.asarray(np.sinc(omega * hold_s / (2 * math.pi)) * np.exp(-0.5j * omega * hold_s))


def measured_response(plant: Operating, timing: Timing, omega: Array) -> Complex:
    """Torque that is read per duty at sampled frequencies [rad/s], without the dead time: hold, plant, latch."""
    h = timing.step_s
    sampled = plant.sampled(np.exp(1j * omega * h), h)
    return np.asarray(sampled * latch_response(timing, omega), dtype=np.complex128)


def loop_response(law: Any, plant: Operating, timing: Timing, omega: Array) -> Complex:
    """Response of the loop opened at the duty, without its dead time, over angular frequency [rad/s]."""
    by_torque = law.response(np.exp(1j * omega * timing.step_s), timing.step_s)
    return np.asarray(by_torque * measured_response(plant, timing, omega), dtype=np.complex128)


def crossovers(law: Any, plant: Operating, timing: Timing) -> list[tuple[float, float]]:
    """Where the loop's gain is 1: the phase that is left to −1, from −π to π, and the frequency [rad/s]."""
    omega = frequencies(plant, timing, 2000)

    def response(omega: float) -> complex:
        return complex(loop_response(law, plant, timing, np.array([omega]))[0])

    above = np.abs(loop_response(law, plant, timing, omega)) >= 1
    phases = []
    for k in np.flatnonzero(above[:-1] != above[1:]):
        at = float(brentq(lambda x: abs(response(x)) - 1, omega[k], omega[k + 1]))
        phases.append((cmath.phase(-response(at) * cmath.exp(-1j * at * timing.delay_s)), at))
    return phases


def frequencies(plant: Operating, timing: Timing, count: int) -> Array:
    """From far below what the slowest lag turns to half the rate of the slower of sampling and latching [rad/s], in
    equal ratios, shape (count,)."""
    slower_hz = min(timing.rate_hz, timing.pwm_hz or timing.rate_hz)
    return np.geomspace(1e-4 / max(1.0, plant.slowest_s), math.pi * slower_hz, count)
