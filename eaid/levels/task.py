"""What is fitted to steps from rest, and the loss it is fitted with.

Huber's is for drop-outs and spikes: squares up to 1.345 robust standard deviations, a line beyond.

Solved by modified residuals (Huber and Dutter 1974): least squares on y* = f + clip(y − f, ±kσ), again and again. At
its fixed point Σ ψ(r) ∂f = 0, which is the minimum of Huber's loss, and every step is a fit of the usual kind.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol, TypeVar

import numpy as np

from eaid.arrays import Array, median
from eaid.estimate.data import Data
from eaid.estimate.points import LevelRecord
from eaid.findings import Finding, finding
from eaid.options import FitOptions
from eaid.steps.stepset import Level, StepSet

K = 1.345  # Huber's constant: 95 % efficient on normal noise
RESIDUALS_SETTLED = 1e-9  # The iteration ends where the residuals move by less than this part of σ
HELD_BACK_MUCH = 0.4  # Share of a level's samples held back, from which it is told; of normal noise 18 % are


@dataclass(frozen=True, eq=False)
class FitTask:
    """Steps from rest that are to be fitted, and how."""

    stepset: StepSet  # With the levels that are not held out
    data: Data  # Their mean curves
    options: FitOptions
    held_out: Sequence[Level]
    progress: Callable[[], None] | None  # Called after each refit of a bootstrap


class Curves(Protocol):
    """A solution whose curves leave something of the levels."""

    def residuals(self, data: Data) -> list[Array]:
        """f − y at every sample of each level, shapes (n_l,)."""


SolutionT = TypeVar("SolutionT", bound=Curves)


def fit_with_loss(
    task: FitTask, subject: str, solve: Callable[[Data, SolutionT | None], SolutionT]
) -> tuple[SolutionT, list[Finding]]:
    """The solution, and levels of which Huber's loss holds back so much that it cannot be spikes; `solve` may go on
    from an earlier solution."""
    data = task.data
    solved = solve(data, None)
    if task.options.loss == "squares":
        return solved, []
    r = solved.residuals(data)
    for _ in range(200):
        sigma = 1.4826 * median(np.abs(np.concatenate(r)))  # by the median of |r|, over all samples
        if sigma == 0.0:
            break
        cut = K * sigma
        # y* = f − clip(f − y) with r = f − y
        records = tuple(
            LevelRecord(record.t_s, record.y + one - np.clip(one, -cut, cut))
            for record, one in zip(data.records, r, strict=True)
        )
        solved = solve(replace(data, records=records), solved)
        after = solved.residuals(data)
        moved = max(float(np.abs(a - b).max()) for a, b in zip(after, r, strict=True)) / sigma
        r = after
        if moved <= RESIDUALS_SETTLED:
            break
    held_back = [0.0 if sigma == 0.0 else float(np.mean(np.abs(one) > K * sigma)) for one in r]
    wide = [u for u, share in zip(data.u.tolist(), held_back, strict=True) if share > HELD_BACK_MUCH]
    told = [finding("huber-holds-back-much", subject, wide, most_pct=100 * HELD_BACK_MUCH)] if wide else []
    return solved, told
