"""Huber's loss for drop-outs and spikes: squares up to 1.345 robust standard deviations, a line beyond.

Solved by modified residuals (Huber and Dutter 1974): least squares on y* = f + clip(y − f, ±kσ), again and again. At
its fixed point Σ ψ(r) ∂f = 0, which is the minimum of Huber's loss, and every step is a fit of the usual kind.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

import msgspec
import numpy as np

from eaid.arrays import Array
from eaid.estimate.data import Data
from eaid.estimate.points import Record
from eaid.findings import Finding, finding
from eaid.results.common import Huber, HuberLevel, HuberPart
from eaid.steps.stepset import Level

K = 1.345
"""Huber's constant: 95 % efficient on normal noise."""
SETTLED = 1e-9
"""The iteration ends where the residuals move by less than this part of σ."""
MOST_PARTS = 3
"""Stretches of one level that are told."""
NEAR = 0.01
"""Samples of low weight nearer than this part of the record are one stretch."""
WIDE = 0.4
"""Share of a level's samples held back from which it is told; 18 % are where the noise is normal and alike."""
APART = 3.0
"""A run is named where it lies this many times further from the middle of the repeats than they mostly do."""
Solved = TypeVar("Solved")


def minimise(
    data: Data,
    loss: str,
    solve: Callable[[Data], Solved],
    again: Callable[[Data, Solved], Solved],
    residuals: Callable[[Solved, Data], list[Array]],
) -> tuple[Solved, Huber | None]:
    """The solution under a loss of the table `LOSSES`, and, for Huber's, its scale and weights in numbers.

    `solve` fits data, `again` fits data that differ little from those of an earlier solution.
    """
    solved = solve(data)
    if loss == "squares":
        return solved, None
    r = residuals(solved, data)
    moved, sigma = np.inf, 0.0
    for _ in range(200):
        sigma = 1.4826 * float(np.median(np.abs(np.concatenate(r))))  # by the median of |r|, over all samples
        if sigma == 0.0:
            break
        cut = K * sigma
        # y* = f − clip(f − y) with r = f − y
        records = tuple(
            Record(record.t_s, record.y + one - np.clip(one, -cut, cut), record.uniform)
            for record, one in zip(data.records, r, strict=True)
        )
        solved = again(replace(data, records=records, together=None), solved)
        after = residuals(solved, data)
        moved = max(float(np.abs(a - b).max()) for a, b in zip(after, r, strict=True)) / sigma
        r = after
        if moved <= SETTLED:
            break
    rows = zip(data.u.tolist(), data.records, r, strict=True)
    weights = tuple(weights_on(u, record.t_s, one, K * sigma) for u, record, one in rows)
    settled = bool(moved <= SETTLED or sigma == 0.0)
    return solved, Huber(k=K, sigma=sigma, settled=settled, weights=weights)


def weights_on(level: float, t_s: Array, residual: Array, cut: float) -> HuberLevel:
    """How Huber's weights min(1, kσ/|r|) fall on one level, and the stretches whose samples count less than half."""
    weight = np.minimum(1.0, cut / np.maximum(np.abs(residual), 1e-300)) if cut > 0 else np.ones_like(residual)
    parts = _parts(t_s, weight)
    return HuberLevel(level, float(np.mean(weight < 1)), float(weight.min()), float(weight.mean()), parts)


def _parts(t_s: Array, weight: Array) -> tuple[HuberPart, ...]:
    """The stretches of weights below a half, the `MOST_PARTS` that lose most, in order of time [s]."""
    low = np.flatnonzero(weight < 0.5)
    if not len(low):
        return ()
    gap = max(1, int(NEAR * len(weight)))
    stretches = np.split(low, np.flatnonzero(np.diff(low) > gap) + 1)
    lost = [float((1 - weight[one]).sum()) for one in stretches]
    kept = sorted(np.argsort(lost)[::-1][:MOST_PARTS].tolist())
    return tuple(
        HuberPart(float(t_s[one[0]]), float(t_s[one[-1]]), len(one), float(weight[one].min()))
        for one in (stretches[i] for i in kept)
    )


def huber_findings(subject: str, info: Huber | None) -> list[Finding]:
    """Levels of which Huber's loss holds back so much that it cannot be spikes."""
    wide = [row.level for row in (info.weights if info else ()) if (row.below_one or 0.0) > WIDE]
    return [finding("huber-holds-back-much", subject, wide, most_pct=100 * WIDE)] if wide else []


def with_runs(info: Huber | None, levels: Sequence[Level]) -> Huber | None:
    """The same with the run of each part that lies furthest from the middle of its repeats; three repeats show it."""
    if info is None:
        return None
    rows = []
    for row, level in zip(info.weights, levels, strict=True):
        parts = tuple(msgspec.structs.replace(part, run=_furthest(part, level)) for part in row.parts)
        rows.append(msgspec.structs.replace(row, parts=parts))
    return msgspec.structs.replace(info, weights=tuple(rows))


def _furthest(part: HuberPart, level: Level) -> str | None:
    inside = (level.time_s >= part.from_s) & (level.time_s <= part.to_s)
    runs = level.runs[:, inside]
    away = np.abs(runs - np.median(runs, axis=0)).mean(axis=1)
    named = len(runs) == 1 or (len(runs) > 2 and away.max() > APART * np.median(away))
    return level.names[int(away.argmax())] if named else None
