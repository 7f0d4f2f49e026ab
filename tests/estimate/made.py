from collections.abc import Callable, Iterable

import numpy as np

from eaid.apparatus import Apparatus
from eaid.steps.stepset import Level, StepSet


def steps_of(
    levels: Iterable[float], curve: Callable[[float], np.ndarray], t: np.ndarray, runs: int = 1, gain: float = 0.0,
    noise: float = 0.0, seed: int | np.random.Generator = 0, units: tuple[str, str] = ("%", "N·m"),
) -> StepSet:  # fmt: skip
    """Steps from rest: `curve` of each level at the instants, every run with a gain of its own and white noise."""
    random, made = np.random.default_rng(seed), []
    for u in levels:
        gains = 1 + gain * random.standard_normal((runs, 1)) if gain else np.ones((runs, 1))
        y = curve(u) * gains + noise * random.standard_normal((runs, len(t)))
        made.append(Level(float(u), t, y, tuple(f"{u:g}-{k}" for k in range(runs))))
    return StepSet("clutch", *units, Apparatus(), tuple(made))
