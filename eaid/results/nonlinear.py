"""The nonlinear part of fit.json: the ten coefficients of Eqs. (4)–(7) by each estimator, and which is believed."""

from typing import Annotated, Any, Literal, Self

import msgspec

from eaid.models.parameters import Nonlinear as NonlinearModel
from eaid.results.common import (
    AbsError,
    HoldOut,
    Huber,
    Interval,
    LevelError,
    Number,
    Positive,
    Result,
    Scores,
    Share,
    Solver,
)
from eaid.results.friction import LevelIntervals

Three = tuple[Number, Number, Number]
Four = tuple[Number, Number, Number, Number]


class CurveLevel(Result, frozen=True):
    """The nonlinear model's curves at one level."""

    level: Number
    Ts: Number | None = None
    tau1: Number | None = None
    tau2: Number | None = None
    ci95: LevelIntervals | None = None
    torque_half_width_nm: Number | None = None
    """Half width of the output curve's interval, largest over the record, in the output's unit."""


class CoefficientIntervals(Result, frozen=True):
    """95 % intervals of the polynomials' coefficients."""

    tau1: tuple[Interval, ...] = ()
    tau2: tuple[Interval, ...] = ()
    Ts: tuple[Interval, ...] = ()
    C: Interval = None


class Covariance(Result, frozen=True):
    """Covariance of the coefficients, so that plants can be drawn."""

    parametrisation: str = ""
    order: tuple[str, ...] = ()
    matrix: tuple[tuple[Number, ...], ...] = ()
    degrees_of_freedom: dict[str, Number | None] = {}
    from_: str = msgspec.field(default="", name="from")


class Disagreement(Result, frozen=True):
    """Where two estimates of one parameter part by more than their intervals."""

    parameter: str
    levels: tuple[Number, ...] = ()
    worst: Number | None = None
    """The level at which they part most."""
    one: Number | None = None
    other: Number | None = None
    ci95: Interval = None
    """Of the first named."""
    ci95_other: Interval = None


class Agreement(Result, frozen=True):
    """Two estimates held against each other."""

    between: tuple[str, str]
    """Which two: joint, two-stage."""
    believe: str
    """One of the two, either, or neither."""
    because: str = ""
    """A code of the table of sentences."""
    disagreements: tuple[Disagreement, ...] = ()


class Estimate(Scores, frozen=True):
    """The ten coefficients of Eqs. (4)–(7) by one estimator."""

    tau1: Three
    tau2: Three
    Ts: Four
    u_range: tuple[Annotated[float, msgspec.Meta(ge=0, le=1e60)], Positive]
    """Lowest and highest identified input."""
    C: Share = 0.85
    C_free: bool = False
    abs_error: AbsError | None = None
    per_level: tuple[LevelError, ...] = ()
    solver: Solver | None = None
    curves: tuple[CurveLevel, ...] = ()
    ci95: CoefficientIntervals | None = None
    covariance: Covariance | None = None
    misfit: dict[str, Number | None] | None = None
    """Two-stage: Σ(residual/sd)² over levels − coefficients."""
    hold_out: HoldOut | None = None

    @property
    def parameters(self) -> NonlinearModel:
        """The model of Eqs. (4)–(7)."""
        return NonlinearModel(self.tau1, self.tau2, self.Ts, self.u_range, self.C)


class Nonlinear(Estimate, frozen=True):
    """The believed estimate, and the others beside it."""

    estimator: Literal["joint", "two-stage"] = "joint"
    """Which estimate stands here: the one that is believed, or that was asked for."""
    because: str = ""
    """Why it stands here: asked, agree, apart, weak, or alone."""
    identifiable: bool | None = None
    robust: Huber | None = None
    joint: Estimate | None = None
    """The joint estimate, where the two-stage one stands in its place."""
    two_stage: Estimate | None = None
    """The two-stage estimate, where the joint one stands."""
    agreement: tuple[Agreement, ...] = ()

    @classmethod
    def of(cls, estimate: Estimate, **more: Any) -> Self:
        """An estimate as the one that is believed."""
        return cls(**{name: getattr(estimate, name) for name in Estimate.__struct_fields__}, **more)

    @property
    def estimate(self) -> Estimate:
        """The estimate that stands here, alone."""
        return Estimate(**{name: getattr(self, name) for name in Estimate.__struct_fields__})
