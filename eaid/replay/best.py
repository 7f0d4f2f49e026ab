"""The least error that a plant allows on a reference, the future known, the duty limited; from above and from below.

From above, two searches, the second from where the first ends:

1. With the slow part x2 given, the torque moves between two limits that are lines in T (the duty at its low or high
   limit), and the best path is exact (`taut`). Follow it, take the x2 it has, again, until nothing changes.
2. Steps that also know what the duty does to x2 (`descent`), each taken only if the true cost falls. They may find a
   duty that switches between its limits from sample to sample, which holds the torque and empties x2.

The end is a local optimum: a duty that has this error, kept beside the replays. From below, the same exact path where
x2 may be anything that any duty could have made of it, chosen anew at each sample, and each limit replaced by a line
that lies outside it: no duty can do better than that.

RMS errors count from the reference's `counted_from_s`, as the controllers' do; before it the best duty is free, and may
wait at rest with an empty slow part. The plant is replayed as it is; what a
rig adds (noise, ripple, delay, latching) is left out.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array, read_only
from eaid.errors import UsageError
from eaid.replay import descent
from eaid.replay.compiled import kernel
from eaid.replay.loop import Trace
from eaid.replay.plant import PlantParameters, falling_taus, plant_terms
from eaid.replay.references import Reference
from eaid.replay.taut import taut_path

ROUNDS = 30
"""Most rounds of the steady search; it settles in about five."""
STEPS = 100
"""Most descent steps."""
ENOUGH = 1e-4
"""The descent ends when ten steps lower the cost by less than this share."""
DUTIES = 201
"""Duties at which the limits of the lower bound are taken, evenly from the lowest to the highest."""


@dataclass(frozen=True, eq=False)
class Best:
    """The least error found, and what says how good it is."""

    time_s: Array
    reference_nm: Array
    torque_nm: Array
    duty_pct: Array
    """The duty that has this error, each value held until the next sample."""
    rms_error_nm: float
    """Least RMS error found: an upper bound of the least there is."""
    bound_nm: float
    """No duty has a smaller RMS error."""
    steady_rms_nm: float
    """Least RMS error without switching from sample to sample (step 1 alone)."""
    max_abs_error_nm: float
    """Largest error of the duty found; another duty may have a smaller one."""

    def trace(self, limits_pct: tuple[float, float]) -> Trace:
        """The best as a replay, to be measured and kept as the controllers' are."""
        dt_s = float(self.time_s[1] - self.time_s[0])
        return Trace("best", dt_s, self.time_s, self.reference_nm, self.torque_nm, self.duty_pct, limits_pct=limits_pct)


def best(
    plant: PlantParameters,
    reference: Reference,
    limits_pct: tuple[float, float] = (0.0, 100.0),
    starts: Sequence[Array] = (),
) -> Best:
    """The best duty for a reference [N·m] from rest; `starts` are further duties [%] to begin from, shape (n,) each."""
    low, high = limits_pct
    if not 0 <= low < high:
        raise UsageError(f"best: duty limits {low:g} to {high:g} do not rise from 0 or above")
    wanted = np.array(reference.torque_nm, dtype=float)
    weight = np.ones(len(wanted))
    weight[: round(reference.counted_from_s / reference.dt_s)] = 0.0
    problem = Problem(plant, wanted, weight, reference.dt_s, (low, high))
    steady_cost, found = _steady(problem)
    cost = steady_cost
    for start in starts:
        candidate = _states(problem)
        other = _roll(problem, _as_state(problem, start), candidate)
        if other < cost:
            cost, found = other, candidate
    cost, found = _descend(problem, cost, found)
    duty, fast, slow = found
    torque = fast + slow
    count = float(weight.sum())
    error = math.sqrt(cost / count)
    return Best(
        time_s=read_only(np.arange(len(wanted)) * reference.dt_s),
        reference_nm=read_only(wanted),
        torque_nm=read_only(torque),
        duty_pct=read_only(duty),
        rms_error_nm=error,
        # they meet where the bound is tight, but for rounding
        bound_nm=min(error, math.sqrt(_bound(problem) / count)),
        steady_rms_nm=math.sqrt(steady_cost / count),
        max_abs_error_nm=float(np.abs((torque - wanted)[weight > 0]).max()),
    )


@dataclass(frozen=True, eq=False)
class Problem:
    """What is to be followed by what."""

    plant: PlantParameters
    reference: Array
    weight: Array
    """1 where the error counts, 0 elsewhere."""
    dt_s: float
    limits: tuple[float, float]


States = tuple[Array, Array, Array]
"""Duty [%], fast and slow part [N·m], shape (n,) each."""


def _states(problem: Problem) -> States:
    n = len(problem.reference)
    return np.zeros(n), np.zeros(n), np.zeros(n)


def _as_state(problem: Problem, duty: Array) -> States:
    return (np.clip(np.asarray(duty, dtype=float), *problem.limits), *_states(problem)[1:])


def _roll(problem: Problem, before: States, after: States, change: States | None = None, share: float = 0.0) -> float:
    """Cost of a duty with a share of a change; fills `after`."""
    p = problem
    change = change or _states(p)
    return float(kernel(descent.rolled)(p.plant, p.reference, p.weight, p.dt_s, p.limits, before, change, share, after))


def _steady(problem: Problem) -> tuple[float, States]:
    """The best path for the slow part that it has itself, found by going round; the best of all rounds."""
    low, high = problem.limits
    slow = np.zeros(len(problem.reference))
    path = np.empty_like(slow)
    least, found = math.inf, _states(problem)
    for _ in range(ROUNDS):
        falls = _line(problem, low, slow, falling=True)
        rises = _line(problem, high, slow, falling=False)
        kernel(taut_path)(problem.reference, problem.weight, *falls, *rises, 0.0, path)
        now = _states(problem)
        kernel(descent.follow)(problem.plant, path, problem.dt_s, low, high, *now)
        cost = _cost(problem, now)
        settled = cost >= least * (1 - 1e-9)
        if cost < least:
            least, found = cost, now
        if settled:
            break
        slow = now[2]
    return least, found


def _cost(problem: Problem, states: States) -> float:
    return float(problem.weight @ (states[1] + states[2] - problem.reference) ** 2)


def _line(problem: Problem, duty: float, slow: Array, falling: bool) -> tuple[Array, Array]:
    """Torque one sample on as a line in T at a duty, for given slow parts: factor and constant, shape (n,)."""
    plant, dt = problem.plant, problem.dt_s
    tau1, tau2, steady = plant_terms(plant, duty)
    if falling:
        tau1, tau2 = falling_taus(plant, duty)
    keep1, keep2 = math.exp(-dt / tau1), math.exp(-dt / tau2)
    gained = plant.C * steady * -math.expm1(-dt / tau1) + (1 - plant.C) * steady * -math.expm1(-dt / tau2)
    return np.full_like(slow, keep1), slow * (keep2 - keep1) + gained


def _descend(problem: Problem, cost: float, now: States) -> tuple[float, States]:
    """Steps that lower the true cost, until they hardly do."""
    p = problem
    change, other = _states(p), _states(p)
    # the plant answers a duty by about T_s/τ dt per 100 %: the damping is small against that squared
    damping = 1e-9
    history = [cost]
    for _ in range(STEPS):
        if cost <= 1e-20 * len(p.reference):
            break
        kernel(descent.improvement)(p.plant, p.reference, p.weight, p.dt_s, p.limits, now, damping, change)
        share = 1.0
        while share > 1e-4:
            reached = _roll(p, now, other, change, share)
            if reached < cost:
                break
            share *= 0.5
        else:
            damping *= 10.0
            if damping > 1e3:
                break
            continue
        now, other, cost = other, now, reached
        damping = max(damping / 5.0, 1e-14)
        history.append(cost)
        if len(history) > 10 and history[-11] - cost < ENOUGH * cost:
            break
    return cost, now


def _bound(problem: Problem) -> float:
    """Cost that no duty can undercut: the exact path between lines that lie outside everything the plant can do.

    From T = x1 + x2 a duty leads to (T − x2) e1 + x2 e2 + gained, which is linear in T and in x2: its extremes over x2
    lie at the ends of what x2 can have reached, its least over the duties is concave in T (a chord lies below it), its
    greatest convex (a chord lies above it). Chords from T = 0 to the highest steady torque.
    """
    duties = np.linspace(*problem.limits, DUTIES).tolist()
    top = max(plant_terms(problem.plant, duty)[2] for duty in duties)
    reach = np.empty(len(problem.reference))
    _, keep2, _, gained2 = _rows(problem, duties, highest=True)
    kernel(descent.slow_reach)(keep2, gained2, reach)
    most = max(float(reach.max()), 1e-12)
    keep1, keep2, gained1, gained2 = _rows(problem, duties, highest=False)
    falls = [
        min((keep1 * t + x2 * (keep2 - keep1) + gained1 + gained2).min() for x2 in (0.0, most)) for t in (0.0, top)
    ]
    keep1, keep2, gained1, gained2 = _rows(problem, duties, highest=True)
    # the greatest is convex in the reach, too: between a hundred values of it, chords again lie above
    some = np.linspace(0.0, most, 101)
    rises = []
    for torque in (0.0, top):
        step = np.multiply.outer(some, keep2 - keep1) + (keep1 * torque + gained1 + gained2)
        rises.append(np.interp(reach, some, np.maximum(step, step[0]).max(axis=1)))
    n = len(reach)
    lines = np.full(n, (falls[1] - falls[0]) / top), np.full(n, falls[0]), (rises[1] - rises[0]) / top, rises[0]
    return float(kernel(taut_path)(problem.reference, problem.weight, *lines, 0.0, np.empty(n)))


def _rows(problem: Problem, duties: list[float], highest: bool) -> tuple[Array, Array, Array, Array]:
    """Lines that bound what each duty does to the two parts in a sample: e1, e2 and what is gained, one row a line.

    With release constants a part follows the rising line above its own path and the release line below: where release
    is slower, the higher of the two, so that the release line alone bounds it from below; where quicker, the lower.
    """
    plant, dt = problem.plant, problem.dt_s

    def constants(rising: float, release: float) -> tuple[float, ...]:
        if release == rising:
            return (rising,)
        if (release > rising) == highest:
            return (rising, release)
        return (rising,) if highest else (release,)

    rows = []
    for duty in duties:
        tau1, tau2, steady = plant_terms(plant, duty)
        release1, release2 = falling_taus(plant, duty)
        for one in constants(tau1, release1):
            for two in constants(tau2, release2):
                lost1, lost2 = -math.expm1(-dt / one), -math.expm1(-dt / two)
                rows.append((1 - lost1, 1 - lost2, plant.C * steady * lost1, (1 - plant.C) * steady * lost2))
    keep1, keep2, gained1, gained2 = np.array(rows).T
    return keep1, keep2, gained1, gained2
