"""The linear model, Eq. (8): Ṫ = −a0 T + b0 u + c0, one lag with an offset, and its step response from rest."""

from dataclasses import dataclass
from typing import Annotated

import msgspec

from eaid.arrays import Array
from eaid.plant.steps import rise

Stored = Annotated[float, msgspec.Meta(ge=-1e60, le=1e60)]  # A number as files of results may hold it


@dataclass(frozen=True)
class LinearPlant:
    """Eq. (8): Ṫ = −a0 T + b0 u + c0."""

    a0: Stored  # [1/s]
    b0: Stored  # [N·m/(s·%)]
    c0: Stored  # [N·m/s]


PAPER_LINEAR = LinearPlant(a0=1.36, b0=0.08, c0=-2.42)  # Eq. (8) as published


def linear_response(p: LinearPlant, t_s: Array, duty_pct: float) -> Array:
    """Output after a step from rest, Eq. (8): T(t) = (b0 u + c0)/a0 · (1 − e^(−a0 t))."""
    return (p.b0 * duty_pct + p.c0) / p.a0 * rise(t_s, 1 / p.a0)


def steady(p: LinearPlant, duty_pct: float) -> float:
    """Output after a long time at an input, (b0 u + c0)/a0."""
    return (p.b0 * duty_pct + p.c0) / p.a0
