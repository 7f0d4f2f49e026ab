"""The linear part of fit.json: Eq. (8) of all levels and of each, and the bounds of B."""

from typing import Any, Literal, Self

from eaid.models.parameters import Linear as LinearModel
from eaid.results.common import HoldOut, Huber, Interval, Number, Result, Scores, Solver


class PooledIntervals(Result, frozen=True):
    """95 % intervals of the pooled linear model."""

    a0: Interval = None
    b0: Interval = None
    c0: Interval = None


class LinearLevelIntervals(Result, frozen=True):
    """95 % intervals of one level's linear model."""

    a0: Interval = None
    gain: Interval = None
    B: Interval = None


class LinearLevel(Scores, frozen=True):
    """Eq. (8) of one level: a0 and the gain (b0 u + c0)/a0 is what one step tells; b0 with c0 = 0."""

    level: Number
    a0: Number
    gain: Number
    b0: Number | None = None
    c0: Number | None = None
    B: Number | None = None
    """1/b0; None where b0 is not positive."""
    converged: bool | None = None
    ci95: LinearLevelIntervals | None = None


class BoundsIntervals(Result, frozen=True):
    """95 % intervals of the ends of B."""

    B_m: Interval = None
    B_M: Interval = None


class Bounds(Result, frozen=True):
    """Least and largest B over the levels that the user keeps."""

    convention: Literal["zero-offset"] = "zero-offset"
    """How b0 of a level is told from c0: c0 is 0."""
    levels: tuple[Number, ...] = ()
    B_m: Number | None = None
    B_M: Number | None = None
    ci95: BoundsIntervals | None = None


class Pooled(Scores, frozen=True):
    """Eq. (8) fitted to all levels at once: Ṫ = −a0 T + b0 u + c0."""

    a0: Number
    b0: Number
    c0: Number
    solver: Solver | None = None
    ci95: PooledIntervals | None = None

    @property
    def parameters(self) -> LinearModel:
        """The model of Eq. (8)."""
        return LinearModel(self.a0, self.b0, self.c0)


class Linear(Pooled, frozen=True):
    """The pooled linear model, and each level's own."""

    per_level: tuple[LinearLevel, ...] = ()
    bounds: Bounds | None = None
    identifiable: bool | None = None
    robust: Huber | None = None
    hold_out: HoldOut | None = None

    def to_control(self) -> Any:
        """The transfer function b0/(s + a0) from input to output, by python-control, where that is installed."""
        import control

        return control.tf([self.b0], [1.0, self.a0])

    @classmethod
    def of(cls, pooled: Pooled, **more: Any) -> Self:
        """A pooled model with each level's own beside it."""
        return cls(**{name: getattr(pooled, name) for name in Pooled.__struct_fields__}, **more)
