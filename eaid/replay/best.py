"""The least error that a plant allows on a reference, the future known, the duty limited; from above and from below.

From above, in two steps:

1. With the slow part x2 given, the torque moves between two limits that are lines in T (the duty at its low or high
   limit), and the best path is exact (`taut_path`). Follow it, take the x2 it has, again, until nothing changes.
2. SciPy's L-BFGS-B over the duty of every sample, with the gradient of `adjoint`. A duty that switches from sample to
   sample can hold the torque and empty x2; the search begins at one that switches about that of step 1, because at a
   held torque, which neither rises nor falls, slopes do not point to it.

What the second finds is taken where it is better than the first.

It is a local optimum: a duty that has this error, kept beside the replays. From below, `least_cost`: no duty can
do better than that.

RMS errors count from the reference's `counted_from_s`, as the controllers' do; before it the best duty is free, and may
wait at rest with an empty slow part. The plant is replayed as it is; what a rig adds (noise, ripple, delay, latching)
is left out.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import Bounds, minimize
from threadpoolctl import threadpool_limits

from eaid.arrays import Array, read_only
from eaid.errors import UsageError
from eaid.replay.adjoint import cost_and_gradient
from eaid.replay.compiled import kernel
from eaid.replay.inverse import follow
from eaid.replay.least_bound import least_cost
from eaid.replay.loop import Trace
from eaid.replay.plant import PlantParameters, falling_taus, plant_terms
from eaid.replay.rate_limited import taut_path
from eaid.replay.references import Reference

ROUNDS = 30
"""Most rounds of the first step; it settles in about five."""
ITERATIONS = 1500
"""Most iterations of the second; on long holds further ones gain less than 1 % more (docs/best-duty.md)."""
ENOUGH = 1e-9
"""It ends when an iteration lowers the cost by less than this share of what it began with."""
SWITCHING = 0.9
"""Its first duty switches through this share of the way to the nearer limit."""
NOTHING_NM = 1e-9
"""An RMS error that is none."""


@dataclass(frozen=True, eq=False)
class Best:
    """The least error found, and what says how good it is."""

    trace: Trace
    """The duty that has this error, each value held until the next sample, and its torque."""
    rms_error_nm: float
    """Least RMS error found: an upper bound of the least there is."""
    bound_nm: float
    """No duty has a smaller RMS error."""
    steady_rms_nm: float
    """Least RMS error without switching from sample to sample (step 1 alone)."""


@dataclass(frozen=True, eq=False)
class _Problem:
    """What is to be followed by what."""

    plant: PlantParameters
    reference: Array
    weight: Array
    """1 where the error counts, 0 elsewhere."""
    dt_s: float
    limits: tuple[float, float]

    def cost(self, torque: Array) -> float:
        """Σ w (T − r)² of a torque [N·m], shape (n,)."""
        return float(np.sum(self.weight * (torque - self.reference) ** 2))


def best(plant: PlantParameters, reference: Reference, limits_pct: tuple[float, float] = (0.0, 100.0)) -> Best:
    """The best duty for a reference [N·m] from rest."""
    low, high = limits_pct
    if not 0 <= low < high:
        raise UsageError(f"best: duty limits {low:g} to {high:g} do not rise from 0 or above")
    wanted = np.array(reference.torque_nm, dtype=float)
    weight = np.ones(len(wanted))
    weight[: reference.begin] = 0.0
    problem = _Problem(plant, wanted, weight, reference.dt_s, (low, high))
    steady_duty, steady = _steady(problem)
    duty, torque = _improved(problem, steady_duty, steady)
    count = float(weight.sum())
    error = math.sqrt(problem.cost(torque) / count)
    bound = math.sqrt(least_cost(plant, wanted, weight, reference.dt_s, (low, high)) / count)
    time_s = np.arange(len(wanted)) * reference.dt_s
    time_s, wanted, torque, duty = (read_only(column) for column in (time_s, wanted, torque, duty))
    return Best(
        Trace("best", reference.dt_s, time_s, wanted, torque, duty, limits_pct),
        error,
        min(error, bound),  # they meet where the bound is tight, but for rounding
        math.sqrt(problem.cost(steady) / count),
    )


def _steady(problem: _Problem) -> tuple[Array, Array]:
    """Duty and torque along the best path for the slow part that it has itself, going round; the best of all rounds."""
    n = len(problem.reference)
    slow, path = np.zeros(n), np.empty(n)
    least, found = math.inf, (slow, slow)
    for _ in range(ROUNDS):
        falls = _line(problem, problem.limits[0], slow, falling=True)
        rises = _line(problem, problem.limits[1], slow, falling=False)
        kernel(taut_path)(problem.reference, problem.weight, *falls, *rises, 0.0, path)
        duty, fast, slow = np.empty(n), np.empty(n), np.empty(n)
        kernel(follow)(problem.plant, path, problem.dt_s, problem.limits, duty, fast, slow)
        cost = problem.cost(fast + slow)
        settled = cost >= least * (1 - 1e-9)
        if cost < least:
            least, found = cost, (duty, fast + slow)
        if settled:
            break
    return found


def _line(problem: _Problem, duty: float, slow: Array, falling: bool) -> tuple[Array, Array]:
    """Torque one sample on as a line in T at a duty, for given slow parts: factor and constant, shape (n,)."""
    plant, dt = problem.plant, problem.dt_s
    tau1, tau2, steady = plant_terms(plant, duty)
    if falling:
        tau1, tau2 = falling_taus(plant, duty)
    keep1, keep2 = math.exp(-dt / tau1), math.exp(-dt / tau2)
    gained = plant.C * steady * -math.expm1(-dt / tau1) + (1 - plant.C) * steady * -math.expm1(-dt / tau2)
    return np.full_like(slow, keep1), slow * (keep2 - keep1) + gained


def _improved(problem: _Problem, duty: Array, torque: Array) -> tuple[Array, Array]:
    """Duty and torque at the end of SciPy's search from a duty; the same ones where it finds nothing better."""
    p, n = problem, len(duty)
    start = p.cost(torque)
    if start <= NOTHING_NM**2 * n:
        return duty, torque
    reached, work = np.empty(n), np.empty((4, n))
    low, high = p.limits
    switching = SWITCHING * np.minimum(duty - low, high - duty) * (-1.0) ** np.arange(n)

    def objective(u: Array) -> tuple[float, Array]:
        gradient = np.empty(n)
        run = kernel(cost_and_gradient)
        cost = run(p.plant, p.reference, p.weight, p.dt_s, p.limits, u, reached, work, gradient)
        return cost / start, gradient / start

    # sums over so many samples by several threads would round otherwise from machine to machine
    with threadpool_limits(1, user_api="blas"):
        search = minimize(
            objective, duty + switching, jac=True, method="L-BFGS-B", bounds=Bounds(*p.limits),
            options={"maxiter": ITERATIONS, "maxfun": 2 * ITERATIONS, "ftol": ENOUGH, "gtol": 0.0},
        )  # fmt: skip
    if not search.fun < 1.0:
        return duty, torque
    objective(search.x)
    return search.x, reached
