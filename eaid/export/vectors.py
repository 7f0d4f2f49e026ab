"""Test vectors of an export: inputs, and what `eaid.export.reference` makes of them in the target's precision.

Cases: steps, a multisine, far beyond the duty limits, inputs that are no numbers, a switch from manual operation; the
torque follows the reference as a slow first-order lag would, so that no plant is needed.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from eaid.export import reference as law
from eaid.export.constants import Constants
from eaid.export.numbers import Precision

GO_ON, RESET, START = 0, 1, 2
"""What comes before a row's step: nothing, a reset, a bumpless start."""
ROWS = 60
"""Rows of the longest case."""


@dataclass(frozen=True)
class Vector:
    """One row; for the plant `reference` is the duty and `expected` the torque, for the rate `expected` is the rate."""

    law: str
    case: str
    before: int
    reference: Any
    rate: Any
    torque: Any
    duty: Any
    """Where a bumpless start begins."""
    expected: Any
    status: int


LAWS: dict[str, tuple[Callable[..., Any], Callable[..., Any], Callable[..., Any], Callable[..., Any]]] = {
    "pi": (law.integral_init, law.integral_reset, law.pi_start, law.pi_step),
    "rc": (law.integral_init, law.integral_reset, law.rc_start, law.rc_step),
    "inverse": (law.inverse_init, law.inverse_reset, law.inverse_start, law.inverse_step),
}
"""Law → init, reset, start, step."""

Row = tuple[str, int, float, float, float, float]


def vectors(constants: Mapping[str, Constants], top: float, precision: Precision) -> list[Vector]:
    """All rows of all laws; `top` is the largest torque of the rig [output unit]."""
    cast: Callable[[float], Any] = np.float32 if precision == "single" else float
    made: list[Vector] = []
    for name in (name for name in constants if name in LAWS):
        made += _controller(name, constants[name], cast, top)
    if "plant" in constants:
        made += _plant(constants["plant"], cast)
    if "rate" in constants:
        made += _rate(constants["rate"], cast, top)
    return made


def _controller(name: str, c: Any, cast: Callable[[float], Any], top: float) -> Iterator[Vector]:
    init, reset, start, step = LAWS[name]
    state = init(c, c.dt)
    for case, before, *numbers in _rows(top, float(c.dt), float(c.duty_min), float(c.duty_max)):
        reference, rate, torque, duty = (cast(number) for number in numbers)
        if before == RESET:
            state = reset(state)
        elif before == START:
            state = start(c, state, reference, rate, torque, duty)
        state, given = step(c, state, reference, rate, torque)
        yield Vector(name, case, before, reference, rate, torque, duty, given, state.guard.status)


def _rows(top: float, dt: float, low: float, high: float) -> Iterator[Row]:
    torque = 0.0
    for k in range(ROWS):
        wanted = top * (0.1, 0.4, 0.2)[k * 3 // ROWS]
        yield "steps", RESET if k == 0 else GO_ON, wanted, 0.0, torque, 0.0
        torque += 0.05 * (wanted - torque)
    for k in range(ROWS):
        angles = [2 * math.pi * f * 8 * k * dt + 1.7 * i * i for i, f in enumerate((0.2, 0.5, 1.0, 2.0, 4.0))]
        wanted = top * (0.4 + 0.05 * sum(math.sin(a) for a in angles))
        slope = (
            top * 0.05 * sum(2 * math.pi * f * math.cos(a) for f, a in zip((0.2, 0.5, 1, 2, 4), angles, strict=True))
        )
        yield "multisine", RESET if k == 0 else GO_ON, wanted, slope, torque, 0.0
        torque += 0.2 * (wanted - torque)
    for k in range(ROWS // 2):
        wanted = top * (3.0 if k < ROWS // 4 else -1.0)
        yield "saturation", RESET if k == 0 else GO_ON, wanted, 0.0, torque, 0.0
        torque += 0.02 * (wanted - torque)
    bad = (math.nan, math.inf, -math.inf, 1e12)
    for k, (place, value) in enumerate((place, value) for place in range(3) for value in bad):
        row = [0.3 * top, 0.0, torque]
        row[place] = value
        yield "bad-input", RESET if k == 0 else GO_ON, row[0], row[1], row[2], 0.0
        yield "bad-input", GO_ON, 0.3 * top, 0.0, torque, 0.0
    for k in range(ROWS // 2):
        duty = low + (high - low) * (0.25 if k < ROWS // 4 else 0.7)
        yield "switch", START if k % (ROWS // 4) == 0 else GO_ON, 0.3 * top, 0.1 * top, 0.29 * top + 1e-3 * k, duty


def _plant(c: Any, cast: Callable[[float], Any]) -> Iterator[Vector]:
    state = law.plant_init(c, c.dt)
    high = float(c.u_high)
    duties = [high * (0.0, 1.0, 0.3, 0.05, 0.0, 1.5, -0.2, 0.6)[k * 8 // (2 * ROWS)] for k in range(2 * ROWS)]
    duties += [math.nan, 0.5 * high, math.inf, 0.5 * high]
    nothing = cast(0.0)
    for k, number in enumerate(duties):
        duty = cast(number)
        state, torque = law.plant_step(c, state, duty)
        case = "steps" if k < 2 * ROWS else "bad-input"
        yield Vector(
            "plant", case, RESET if k == 0 else GO_ON, duty, nothing, nothing, nothing, cast(torque), state.status
        )


def _rate(c: Any, cast: Callable[[float], Any], top: float) -> Iterator[Vector]:
    state = law.rate_init()
    nothing = cast(0.0)
    for k in range(ROWS):
        number = math.nan if k == ROWS // 2 else top * (0.2 + 0.1 * math.sin(0.3 * k)) + (0.5 if k >= 45 else 0.0)
        state, rate = law.rate_step(c, state, cast(number))
        before = RESET if k == 0 else GO_ON
        yield Vector("rate", "rate", before, cast(number), nothing, nothing, nothing, cast(rate), 0)
