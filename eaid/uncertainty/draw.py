"""Plants drawn from a fit's uncertainty: other models that the same data would allow.

Coefficients are drawn from a normal distribution with the covariance kept in fit.json (`nonlinear.covariance`). The
constraints of the fit (τ1 ≥ 1 ms, τ2 ≥ τ1, T_s ≥ 0 over the identified duties) are linear in the coefficients: a draw
that breaks one is drawn again, and after many refusals pulled back along the line to the fit until it keeps them.
"""

from typing import Any

import numpy as np

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.fitting.stored import nonlinear_from_json
from eaid.models.parameters import Nonlinear
from eaid.uncertainty.joint import constraints

PARAMETRISATION = "coefficients of (u/100 %)^k, lowest power first: tau1 [s], tau2 [s], Ts [N·m]"
"""What the rows and columns of `nonlinear.covariance.matrix` are, in this order."""
TRIES = 200


def covariance_word(fit: dict[str, Any]) -> str | None:
    """Why no plants can be drawn from this fit.json, in a sentence; None where they can."""
    stored = (fit.get("nonlinear") or {}).get("covariance")
    if not isinstance(stored, dict) or not stored.get("matrix"):
        return (
            "this fit holds no covariance of the nonlinear model, so every drawn plant is the fitted one; "
            "fit again with --ci robust to carry the uncertainty on"
        )
    return None


def draw_plants(fit: dict[str, Any], n: int, seed: int) -> list[Nonlinear]:
    """`n` plants that the data of a fit.json allow; the same seed gives the same plants.

    Without a covariance in the file all of them are the fitted plant (`covariance_word` says so).
    """
    centre = nonlinear_from_json(fit)
    if covariance_word(fit) is not None:
        return [centre] * n
    counts = (len(centre.tau1), len(centre.tau2), len(centre.Ts))
    total = sum(counts)
    stored = fit["nonlinear"]["covariance"]
    free = (stored.get("order") or [""])[-1] == "C"
    matrix = np.array(stored["matrix"], dtype=np.float64)
    if matrix.shape != (total + free,) * 2 or not np.isfinite(matrix).all():
        raise DataError(
            f"nonlinear.covariance.matrix: shape {matrix.shape}, expected {total + free} x {total + free} finite "
            "numbers; fit again"
        )
    scale = np.concatenate([100.0 ** np.arange(count) for count in counts] + [np.ones(int(free))])
    mean = np.concatenate([centre.tau1, centre.tau2, centre.Ts, [centre.C] * free]) * scale
    root = _root(matrix)
    slack, offset = constraints(counts, centre.u_range)
    if free:  # C between 0 and 1 as well
        slack = np.block([[slack, np.zeros((len(slack), 1))], [np.zeros((2, total)), np.array([[1.0], [-1.0]])]])
        offset = np.append(offset, [0.0, -1.0])
    random = np.random.default_rng(seed)
    plants = []
    first, second, third = np.cumsum(counts).tolist()
    at_fit = slack @ mean - offset
    allowed = np.minimum(at_fit, 0.0) - 1e-12  # every constraint, as far as the fit itself keeps it
    for _ in range(n):
        drawn = (_feasible(mean, root, slack, at_fit, allowed, random) / scale).tolist()
        plants.append(
            Nonlinear(
                tau1=tuple(drawn[:first]),
                tau2=tuple(drawn[first:second]),
                Ts=tuple(drawn[second:third]),
                u_range=centre.u_range,
                C=drawn[third] if free else centre.C,
                release=centre.release,
            )
        )
    return plants


def _root(matrix: Array) -> Array:
    """A root of the covariance, found in scaled form: its condition is that of the correlations."""
    sd = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    unit = np.where(sd > 0, sd, 1.0)
    values, vectors = np.linalg.eigh(matrix / np.outer(unit, unit))
    # a sign of its own for each vector, so that the same file gives the same plants on every machine
    vectors = vectors * np.where(vectors[np.abs(vectors).argmax(axis=0), np.arange(len(sd))] < 0, -1.0, 1.0)
    return np.asarray(unit[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


def _feasible(
    mean: Array, root: Array, slack: Array, at_fit: Array, allowed: Array, random: "np.random.Generator"
) -> Array:
    """One draw whose slack, `at_fit` at the mean, is nowhere below what is allowed."""
    step = np.zeros_like(mean)
    for _ in range(TRIES):
        step = root @ random.standard_normal(len(mean))
        if (at_fit + slack @ step >= allowed).all():
            return mean + step
    change = slack @ step
    falling = change < 0
    reach = float(np.min((allowed[falling] - at_fit[falling]) / change[falling]))
    return np.asarray(mean + 0.999 * max(0.0, min(1.0, reach)) * step)
