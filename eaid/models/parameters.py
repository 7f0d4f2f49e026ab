"""The parameters of the three models, in the units of specification 1, polynomials lowest power first."""

from dataclasses import dataclass
from typing import Annotated

import msgspec

SHARE = 0.85  # C: share of the fast part, held at the paper's value unless the user sets or frees it
TAU_FLOOR_S = 1e-3  # Least τ1 of a fit and of a replay [s], specification 3


@dataclass(frozen=True)
class Friction:
    """Eq. (3) for one level: T(t) = (C (1 − e^(−t/τ1)) + (1 − C)(1 − e^(−t/τ2))) T_s."""

    Ts: float  # Steady torque [N·m]
    tau1: float  # Fast time constant [s]
    tau2: float  # Slow time constant [s]
    C: float = SHARE


@dataclass(frozen=True)
class Nonlinear:
    """Eqs. (4)–(7): the same curve with τ1(u), τ2(u) and T_s(u) polynomials of the duty u [%]."""

    tau1: tuple[float, ...]  # τ1(u) [s], three coefficients by default
    tau2: tuple[float, ...]  # τ2(u) [s], three by default
    Ts: tuple[float, ...]  # T_s(u) [N·m], four by default
    u_range: tuple[float, float]  # Lowest and highest identified duty [%]; outside, specification 4.2 rules
    C: float = SHARE
    # (τ1, τ2) of the release [s], where falling edges were fitted; for falls to rest only
    release: tuple[float, float] | None = None
    # Falls between identified duties were recorded too, and have the release's time constants
    falls_as_release: bool = False


Stored = Annotated[float, msgspec.Meta(ge=-1e60, le=1e60)]  # A number as files of results may hold it


@dataclass(frozen=True)
class Linear:
    """Eq. (8): Ṫ = −a0 T + b0 u + c0."""

    a0: Stored  # [1/s]
    b0: Stored  # [N·m/(s·%)]
    c0: Stored  # [N·m/s]


# Specification 6: Table III's time constants, and a T_s(u) that gives back the paper's linear model. Synthetic.
REFERENCE_PLANT = Nonlinear(
    tau1=(6.74e-3, 2.39e-2, -2.13e-4),
    tau2=(0.93, 0.41, -2.64e-3),
    Ts=(0.032, 9.2e-3, 2.1e-4, 1.32e-6),
    u_range=(10.0, 100.0),
)

PAPER_LINEAR = Linear(a0=1.36, b0=0.08, c0=-2.42)  # Eq. (8) as published
