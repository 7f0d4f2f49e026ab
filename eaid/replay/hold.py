"""From one control sample to the next, where the reference is not known beforehand: output, delay, plant.

The lines of `eaid.replay.loop.closed_loop` that follow the controller, with a memory of their own; a test holds the two
together.
"""

import math

from eaid.replay.loop import INSTANT
from eaid.replay.plant import PlantParameters, plant_step
from eaid.replay.rig import RigNumbers


class Hold:
    """The clutch behind the controller's output, from rest."""

    def __init__(self, plant: PlantParameters, rig: RigNumbers, dt_s: float) -> None:
        self._plant, self._rig, self._dt = plant, rig, dt_s
        self._x1 = self._x2 = self._latched = 0.0
        self._pulse = 0
        self._given: list[float] = []

    def torque(self) -> float:
        """Torque of the plant now [N·m], without rotor ripple."""
        return self._x1 + self._x2

    def advance(self, k: int, duty_pct: float) -> tuple[float, float]:
        """Apply what the controller gave at sample k; the duty after rounding, and the mean duty applied [%]."""
        _, resolution, delay, period = self._rig
        if resolution > 0.0:
            duty_pct = math.floor(duty_pct / resolution + 0.5) * resolution
        u = duty_pct
        if delay > 0:
            self._given.append(duty_pct)
            u = self._given[k - delay] if k >= delay else 0.0
        if period == 0.0:
            self._move(u, self._dt)
            return duty_pct, u
        wait = self._pulse * period - k
        if wait >= 1.0 - INSTANT:
            self._move(self._latched, self._dt)
            return duty_pct, self._latched
        wait = max(wait, 0.0)
        self._move(self._latched, wait * self._dt)
        self._move(u, (1.0 - wait) * self._dt)
        mean = wait * self._latched + (1.0 - wait) * u
        self._latched = u
        self._pulse = math.ceil((k + 1 - INSTANT) / period)
        return duty_pct, mean

    def _move(self, duty_pct: float, seconds: float) -> None:
        self._x1, self._x2 = plant_step(self._plant, self._x1, self._x2, duty_pct, seconds)
