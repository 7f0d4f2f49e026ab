"""Runs made by formula, for the tests of steps."""

from collections.abc import Sequence

import numpy as np

from eaid.arrays import Array, read_only
from eaid.logs.run import Run


def curve(t_s: Array, tau1: float = 0.2, tau2: float = 1.0, share: float = 0.85) -> Array:
    """Eq. (4) for a unit step at 0; 0 before it."""
    t = np.maximum(t_s, 0.0)
    return share * -np.expm1(-t / tau1) + (1 - share) * -np.expm1(-t / tau2)


def log(
    plan: Sequence[tuple[float, float]],
    *,
    rate_hz: float = 100.0,
    gain: float = 0.04,
    start_s: float = 0.0,
    offset: float = 0.0,
    noise: float = 0.0,
    seed: int = 0,
    name: str = "a",
    tau1: float = 0.2,
    tau2: float = 1.0,
    **more: object,
) -> Run:
    """A log that holds each (input, seconds) of the plan in turn, on a plant that is linear in the input."""
    counts = [round(seconds * rate_hz) for _, seconds in plan]
    u = np.concatenate([np.full(count, level) for (level, _), count in zip(plan, counts, strict=True)])
    t = np.arange(len(u)) / rate_hz
    y = np.full(len(u), offset)
    before, at = 0.0, 0
    for (level, _), count in zip(plan, counts, strict=True):
        y += (
            gain
            * (level - before)
            * np.where(np.arange(len(u)) >= at, curve(t - t[min(at, len(t) - 1)], tau1, tau2), 0)
        )
        before, at = level, at + count
    y = y + noise * np.random.default_rng(seed).normal(size=len(y))
    facts: dict[str, object] = {
        "input_unit": "%",
        "output_unit": "N·m",
        "source": f"{name}.csv",
        "sha256": "0",
        "kind": "clutch",
    }
    return Run(name=name, time_s=read_only(t + start_s), input=read_only(u), output=read_only(y), **(facts | more))  # type: ignore[arg-type]
