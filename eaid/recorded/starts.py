"""Where the fits of recorded logs start: shapes of τ1(u) and τ2(u) with everything linear solved for, the best first.

For given τ1(u), τ2(u) the response is linear in the coefficients of T_s, the idle outputs and the start states.
Constant pairs over a log grid come first, as the linear model and a step inside the log would show them; the best of
these are then bent, τ1 and τ2 rising or falling over the inputs; and τ2 passes through a few values at three inputs.
"""

import itertools

import numpy as np

from eaid.arrays import Array
from eaid.fitting.problem import Problem, bring_in, draw_in
from eaid.fitting.solver import approach
from eaid.models.parameters import TAU_FLOOR_S
from eaid.recorded.linear_parts import linear_parts
from eaid.recorded.problem import Setup

FAST = 17
"""Values of τ on the grid, from half a sample to the longest log."""
BENT = 3
"""Minima over the grid that are bent."""
BENDS = (0.2, 1.0, 5.0)
"""Ratio of a bent τ at the highest input to that at the lowest."""
SHAPES = 4
"""Values of τ2 tried at each of three inputs."""
SIEVED = 8
"""Best of those shapes that go a few steps down …"""
SIEVE_STEPS = 3
"""… so many."""
MOST = 5
"""Starts handed on."""
DISTINCT = 1e-4
"""Starts whose costs differ by less than this part are one."""


def starts(setup: Setup, problem: Problem) -> list[Array]:
    """Feasible starts, the most promising first, and a plain one with constant τ last."""
    model = setup.model
    shortest, longest = spans(setup)
    fast = np.geomspace(max(0.5 * shortest, 2 * TAU_FLOOR_S), longest, FAST)
    slow = fast if model.sizes[2] else fast[-1:] * 2
    shares = [0.85] if model.share is not None else [0.5, 0.7, 0.85, 0.95]
    every = itertools.product(range(len(shares)), range(FAST), range(len(slow)))
    pairs = [(h, i, j) for h, i, j in every if slow[j] > 1.5 * fast[i]]
    cost, x = linear_parts(setup, [_shaped(setup, fast[i], slow[j], shares[h]) for h, i, j in pairs])
    grid = np.full((len(shares), FAST + 2, len(slow) + 2), np.inf)
    for (h, i, j), one in zip(pairs, cost.tolist(), strict=True):
        grid[h, i + 1, j + 1] = one
    least = [k for k, (h, i, j) in enumerate(pairs) if cost[k] <= grid[h, i : i + 3, j : j + 3].min()]
    least.sort(key=lambda k: float(cost[k]))
    flat = inner(setup, x[least[0]], problem)
    places = [(float(cost[k]), x[k]) for k in least[:MOST]]
    if model.name == "nonlinear" and min(model.sizes) > 1:
        bent = [
            _shaped(setup, fast[i], slow[j], shares[h], *bends)
            for h, i, j in (pairs[k] for k in least[:BENT])
            for bends in itertools.product(BENDS, repeat=2)
        ]
        places += zip(*linear_parts(setup, bent), strict=True)
    places.sort(key=lambda row: row[0])
    if model.name == "nonlinear" and model.sizes[2] > 1:
        cost, x = linear_parts(setup, slow_shapes(setup, places[0][1], longest))
        for k in np.argsort(cost)[:SIEVED]:
            end = approach(problem, bring_in(x[k], flat, problem), steps=SIEVE_STEPS)
            places.append((end.cost, end.x))
        places.sort(key=lambda row: row[0])
    chosen: list[tuple[float, Array]] = []
    for one, place in places:
        if all(abs(one - other) > DISTINCT * other for other, _ in chosen):
            chosen.append((one, place))
        if len(chosen) == MOST:
            break
    return [bring_in(place, flat, problem) for _, place in chosen] + [flat]


def slow_shapes(setup: Setup, x: Array, longest: float) -> Array:
    """x with every τ2(u) through a few values at the lowest, middle and highest input: joint costs have several minima
    far apart in τ2, where holds are short."""
    basis = setup.model.basis
    assert basis is not None
    at = np.array([basis.lowest, 0.5 * (basis.lowest + basis.highest), basis.highest])
    rows = setup.model.rows_of(at)
    a, b, c = setup.model.sizes
    typical = max(float(rows.tau1[1] @ x[a : a + b]), 2 * TAU_FLOOR_S)
    values = np.geomspace(3 * typical, max(3 * longest, 30 * typical), SHAPES)
    threes = np.array(list(itertools.product(values, repeat=3)))
    found = np.tile(x, (len(threes), 1))
    found[:, a + b : a + b + c] = threes @ np.linalg.pinv(rows.tau2).T
    return found


def spans(setup: Setup) -> tuple[float, float]:
    """The typical time between samples and the length of the longest log [s]."""
    rows = [drive.dt_s[drive.dt_s > 0] for drive in setup.drives]
    return float(np.median(np.concatenate(rows))), max(float(one.sum()) for one in rows)


def _shaped(setup: Setup, tau1: float, tau2: float, share: float, bend1: float = 1.0, bend2: float = 1.0) -> Array:
    """x with τ1 and τ2 that run straight from τ/√bend to τ √bend, everything else 0."""
    model = setup.model
    x = np.zeros(setup.size)
    a, b, c = model.sizes
    if model.name == "friction":
        x[a : a + b], x[a + b : a + b + c] = tau1, tau2
    else:
        for at, count, tau, bend in ((a, b, tau1, bend1), (a + b, c, tau2, bend2)):
            if count:
                x[at] = 0.5 * tau * (bend**0.5 + bend**-0.5)
            if count > 1:
                x[at + 1] = 0.5 * tau * (bend**0.5 - bend**-0.5)
    if model.share is None:
        x[model.size - 1] = share
    return x


def inner(setup: Setup, x: Array, problem: Problem) -> Array:
    """A feasible point with constant τ near `x`: T_s is drawn to its mean where it falls below 0."""
    model = setup.model
    a, b, c = model.sizes
    flat = x.copy()
    one = x[a : a + b].mean() if model.name == "friction" else x[a]
    two = x[a + b : a + b + c].mean() if model.name == "friction" else (x[a + b] if c else 1.0)
    one = max(float(one), 2 * TAU_FLOOR_S)
    two = max(float(two), 1.5 * one)
    keep = _shaped(setup, one, two, float(x[model.size - 1]))
    flat[a : a + b + c] = keep[a : a + b + c]
    calm = flat.copy()
    if model.name == "friction":
        calm[:a] = max(float(np.mean(x[:a])), 1e-12)
    elif model.name == "nonlinear":
        calm[:a] = 0.0
        calm[0] = max(float(x[0]), 1e-12)
    return draw_in(flat, calm, problem)
