"""Is the fit the best there is? Random plants and noise seeds, ours against an independent multi-start.

`python -m benchmarks.fit_quality [COUNT]` prints one line a plant that misses, then the count and the worst.

The other solver shares nothing with eaid: coefficients of (u/100)^k, every sample, its own model and derivatives,
`scipy.optimize.least_squares` from random starts with the constraints as a steep penalty. Costs of both are computed
here, at points that keep the constraints.
"""

import sys
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from eaid.arrays import Array
from eaid.estimate.data import Data
from eaid.estimate.points import LevelRecord
from eaid.levels.from_steps import fit_nonlinear

BAR, SHARE = 1e-6, 0.85
LEVELS = np.arange(10.0, 101.0, 10.0)
REFERENCE = np.array([0.00674, 2.39, -2.13, 0.93, 41.0, -26.4, 0.032, 0.92, 2.1, 1.32])
"""The reference plant, specification 6, in powers of u/100."""


def powers(v: Array, n: int) -> Array:
    return np.vander(v, n, increasing=True)


def constraint_rows() -> tuple[Array, Array]:
    """A x ≥ b: τ1 ≥ 1 ms, τ2 ≥ τ1, T_s ≥ 0 at 101 duties."""
    duties = np.linspace(10.0, 100.0, 101) / 100
    three, four = powers(duties, 3), powers(duties, 4)
    zero3, zero4 = np.zeros_like(three), np.zeros_like(four)
    rows = [[three, zero3, zero4], [-three, three, zero4], [zero3, zero3, four]]
    return np.block(rows), np.concatenate([np.full(101, 1e-3), np.zeros(202)])


A, B = constraint_rows()


@dataclass(frozen=True)
class Case:
    """One simulated experiment: the mean of its repeats at ten levels on one time axis."""

    seed: int
    t_s: Array
    y: Array
    truth: Array


def random_plant(rng: np.random.Generator, tight: bool = False) -> Array:
    """Ten coefficients of (u/100)^k that keep the constraints, τ1 0.05…1 s, τ2 2…20 s, T_s rising.

    `tight`: τ2 meets τ1 at the lowest level, or T_s is nearly 0 there: noise pushes the optimum against a constraint.
    """
    while True:
        edges1 = np.exp(rng.uniform(np.log(0.05), np.log(1.0), 3))
        edges2 = np.exp(rng.uniform(np.log(2.0), np.log(20.0), 3))
        at = np.array([0.1, 0.55, 1.0])
        tau1, tau2 = np.linalg.solve(powers(at, 3), edges1), np.linalg.solve(powers(at, 3), edges2)
        steady = np.sort(np.exp(rng.uniform(np.log(0.1), np.log(5.0), 4)))
        if tight:
            edges2[0] = edges1[0] * rng.uniform(1.0, 1.05)
            steady[0] *= rng.uniform(0.01, 0.3)
        Ts = np.linalg.solve(powers(np.array([0.1, 0.4, 0.7, 1.0]), 4), steady)
        x = np.concatenate([tau1, tau2, Ts])
        slack = A @ x - B
        room = (0.0, 0.0, 0.0) if tight else (0.02, 0.2, 0.02)
        if all(part.min() > least for part, least in zip(np.split(slack, 3), room, strict=True)):
            return x


def make(seed: int) -> Case:
    """Plant, record length, noise and scatter of one seed.

    Every fourth is the reference plant, every other one tight against its constraints; every other set has run-to-run
    scatter, so that the model is wrong.
    """
    rng = np.random.default_rng(seed)
    x = REFERENCE if seed % 4 == 1 else random_plant(rng, tight=seed % 4 >= 2)
    t = np.arange(int(rng.choice([500, 1000, 2000]))) * float(rng.choice([0.01, 0.02]))
    noise = float(np.exp(rng.uniform(np.log(0.02 if seed % 4 >= 2 else 0.002), np.log(0.05))))
    theta = levels_of(x)
    if seed % 2:
        theta = theta * np.exp(np.array([[0.05], [0.1], [0.03]]) * rng.normal(size=theta.shape) / np.sqrt(3))
    return Case(seed, t, curves(t, theta) + noise * rng.normal(size=(len(LEVELS), len(t))), x)


def levels_of(x: Array) -> Array:
    """τ1, τ2, T_s at the levels, shape (3, 10)."""
    v = LEVELS / 100
    return np.stack([powers(v, 3) @ x[:3], powers(v, 3) @ x[3:6], powers(v, 4) @ x[6:]])


def curves(t: Array, theta: Array) -> Array:
    tau1, tau2, Ts = theta[:, :, None]
    return Ts * (1 - SHARE * np.exp(-t / tau1) - (1 - SHARE) * np.exp(-t / tau2))


def guarded(x: Array) -> Array:
    theta = levels_of(x)
    theta[:2] = np.maximum(theta[:2], 1e-4)
    return theta


def cost(x: Array, case: Case) -> float:
    return float(np.sum((curves(case.t_s, guarded(x)) - case.y) ** 2))


def penalised(case: Case, x: Array, steep: float) -> Array:
    """Least squares with what breaks a constraint as further residuals."""
    t, v = case.t_s, LEVELS / 100

    def residual(x: Array) -> Array:
        return np.concatenate([(curves(t, guarded(x)) - case.y).ravel(), steep * np.minimum(A @ x - B, 0)])

    def jacobian(x: Array) -> Array:
        tau1, tau2, Ts = guarded(x)[:, :, None]
        e1, e2 = np.exp(-t / tau1), np.exp(-t / tau2)
        parts = (-Ts * SHARE * e1 * t / tau1**2, -Ts * (1 - SHARE) * e2 * t / tau2**2)
        parts = (*parts, 1 - SHARE * e1 - (1 - SHARE) * e2)
        columns = [part * w[:, None] for part, n in zip(parts, (3, 3, 4), strict=True) for w in powers(v, n).T]
        made = np.stack([column.ravel() for column in columns], axis=1)
        return np.vstack([made, steep * A * ((A @ x - B) < 0)[:, None]])

    fitted = least_squares(residual, x, jacobian, x_scale="jac", ftol=1e-14, xtol=1e-14, gtol=1e-14, max_nfev=200)
    return np.asarray(fitted.x)


def best_of_others(case: Case, starts: int = 12) -> float:
    """Least cost of the independent multi-start, each end drawn inwards until it keeps the constraints to rounding."""
    rng, inner, best = np.random.default_rng(10_000 + case.seed), np.array([0.3, 0, 0, 6, 0, 0, 0.5, 0, 0, 0]), np.inf
    for k in range(starts):
        x = case.truth if k == 0 else random_plant(rng)
        for steep in (1e2, 1e4, 1e6):
            x = penalised(case, x, steep)
        slack, room = A @ x - B, A @ inner - B
        out = slack < 0
        part = float(np.max(slack[out] / (slack[out] - room[out]))) if out.any() else 0.0
        best = min(best, cost(x + part * (inner - x), case))
    return best


def ours(case: Case) -> tuple[float, bool]:
    """Our cost by the sum above, and our verdict."""
    found = fit_nonlinear(Data(LEVELS, tuple(LevelRecord(case.t_s, y) for y in case.y)), SHARE)
    p = found.parameters
    x = np.concatenate([c * 100.0 ** np.arange(len(c)) for c in (p.tau1, p.tau2, p.Ts)])
    assert (A @ x - B).min() > -1e-9, "a constraint is broken"
    return cost(x, case), found.solver.converged


def main(count: int = 200) -> None:
    worst, missed, unsure = -np.inf, 0, 0
    for seed in range(count):
        case = make(seed)
        mine, converged = ours(case)
        over = mine / best_of_others(case) - 1
        worst, missed, unsure = max(worst, over), missed + (over > BAR), unsure + (not converged)
        if over > BAR or not converged:
            print(f"seed {seed}: {over:+.1e}, converged {converged}", flush=True)
    print(f"{count - missed} of {count} within {BAR:g} of the best known cost; worst {worst:+.1e}; {unsure} unsure")


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:2]))
