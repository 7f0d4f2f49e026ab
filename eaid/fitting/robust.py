"""Huber's loss for drop-outs and spikes: squares up to 1.345 robust standard deviations, a line beyond.

Solved by modified residuals (Huber and Dutter 1974): least squares on y* = f + clip(y − f, ±kσ), again and again. At
its fixed point Σ ψ(r) ∂f = 0, which is the minimum of Huber's loss, and every step is a fit of the usual kind.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from eaid.arrays import Array
from eaid.fitting.data import Data
from eaid.fitting.kernel import Record

K = 1.345
"""Huber's constant: 95 % efficient on normal noise."""
SETTLED = 1e-9
"""The iteration ends where the residuals move by less than this part of σ."""
Solved = TypeVar("Solved")


def minimise(
    data: Data,
    loss: str,
    solve: Callable[[Data], Solved],
    again: Callable[[Data, Solved], Solved],
    residuals: Callable[[Solved, Data], list[Array]],
) -> tuple[Solved, dict[str, Any] | None]:
    """The solution under a loss of the table `LOSSES`, and, for Huber's, its scale and weights in numbers.

    `solve` fits data, `again` fits data that differ little from those of an earlier solution.
    """
    solved = solve(data)
    if loss == "squares":
        return solved, None
    return _huber(data, solved, again, residuals)


def _huber(
    data: Data,
    solved: Solved,
    again: Callable[[Data, Solved], Solved],
    residuals: Callable[[Solved, Data], list[Array]],
) -> tuple[Solved, dict[str, Any]]:
    r = residuals(solved, data)
    rounds, moved, sigma = 0, np.inf, 0.0
    while moved > SETTLED and rounds < 200:
        sigma = scale_of(r)
        if sigma == 0.0:
            break
        cut = K * sigma
        # y* = f − clip(f − y) with r = f − y
        records = tuple(
            Record(record.t_s, record.y + one - np.clip(one, -cut, cut), record.uniform)
            for record, one in zip(data.records, r, strict=True)
        )
        solved = again(replace(data, records=records, together=None), solved)
        found = residuals(solved, data)
        moved = max(float(np.abs(a - b).max()) for a, b in zip(found, r, strict=True)) / sigma
        r = found
        rounds += 1
    return solved, {
        "loss": "huber",
        "k": K,
        "sigma": sigma,
        "rounds": rounds,
        "settled": bool(moved <= SETTLED or sigma == 0.0),
        "weights": [weight_row(float(u), one, K * sigma) for u, one in zip(data.u, r, strict=True)],
    }


def scale_of(residuals: list[Array]) -> float:
    """σ by the median of |residual|, 1.4826 MAD, over all samples."""
    return 1.4826 * float(np.median(np.abs(np.concatenate(residuals))))


def weight_row(level: float, residual: Array, cut: float) -> dict[str, float]:
    """How Huber's weights min(1, kσ/|r|) fall on one level: share of samples held back, least and mean weight."""
    weight = np.minimum(1.0, cut / np.maximum(np.abs(residual), 1e-300)) if cut > 0 else np.ones_like(residual)
    return {
        "level": level,
        "below_one": float(np.mean(weight < 1)),
        "least": float(weight.min()),
        "mean": float(weight.mean()),
    }
