"""From one control sample to the next: the output's resolution, the PWM's latch, and the plant behind it.

Exact also where a PWM period is no whole number of samples: the interval is cut where the new duty takes over. Floats
and `math` only: numba compiles these functions as they stand.
"""

import math
from typing import NamedTuple

from eaid.replay.plant import PlantParameters, plant_step

INSTANT = 1e-9
"""Two instants nearer than this share of a sample are one."""


class Held(NamedTuple):
    """Where plant and latch are."""

    x1: float
    """Fast part of the torque [N·m]."""
    x2: float
    """Slow part [N·m]."""
    latched: float
    """Duty that acts [%]."""
    pulse: int
    """The next PWM period to begin, at pulse·period samples."""


def rest() -> Held:
    """At rest, before the first pulse."""
    return Held(0.0, 0.0, 0.0, 0)


def rounded(duty: float, resolution: float) -> float:
    """The duty [%] as an output of this resolution [%] gives it; 0: any."""
    return math.floor(duty / resolution + 0.5) * resolution if resolution > 0.0 else duty


def hold_step(plant: PlantParameters, period: float, dt: float, k: int, duty: float, held: Held) -> tuple[Held, float]:
    """From sample k to the next with a duty [%], latched once a PWM period [samples; 0: at once]; and the mean duty."""
    x1, x2, latched, pulse = held
    if period == 0.0:
        x1, x2 = plant_step(plant, x1, x2, duty, dt)
        return Held(x1, x2, duty, pulse), duty
    wait = pulse * period - k
    if wait >= 1.0 - INSTANT:
        x1, x2 = plant_step(plant, x1, x2, latched, dt)
        return Held(x1, x2, latched, pulse), latched
    wait = max(wait, 0.0)
    x1, x2 = plant_step(plant, x1, x2, latched, wait * dt)
    x1, x2 = plant_step(plant, x1, x2, duty, (1.0 - wait) * dt)
    return Held(x1, x2, duty, math.ceil((k + 1 - INSTANT) / period)), wait * latched + (1.0 - wait) * duty
