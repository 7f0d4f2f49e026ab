"""The friction part of fit.json: a curve for each level, Eq. (3), trends over stress or speed, and falls to rest."""

from typing import Literal

import msgspec
import numpy as np

from eaid.arrays import Array
from eaid.models.friction import step_response
from eaid.models.parameters import Friction as FrictionCurve
from eaid.models.trends import evaluate
from eaid.results.common import Count, HoldOut, Huber, Interval, Number, Positive, Result, Scores, Solver


class LevelIntervals(Result, frozen=True):
    """95 % intervals of one level's T_s, τ1, τ2, and C where it was free."""

    Ts: Interval = None
    tau1: Interval = None
    tau2: Interval = None
    C: Interval = None
    C_f: Interval = None


class FrictionLevel(Scores, frozen=True):
    """The step response of one level, Eq. (3), or of one step between two levels."""

    level: Number
    Ts: Number
    """Steady output; between two levels the change of it."""
    tau1: Positive
    tau2: Positive
    C: Number = 0.85
    from_: Number = msgspec.field(default=0.0, name="from")
    """Input before the step."""
    start: Number = 0.0
    """Output before the step, above the baseline that was subtracted."""
    shape: str = "two"
    """one | two | free | overshoot: the form that the evidence asked for; the paper's is two."""
    delay_s: Number = 0.0
    """Dead time."""
    stress_kpa: Number | None = None
    speed_rpm: Number | None = None
    samples: Count | None = None
    C_f: Number | None = None
    """Coefficient of friction, Eq. (1)."""
    solver: Solver | None = None
    ci95: LevelIntervals | None = None

    @property
    def curve(self) -> FrictionCurve:
        """The curve of Eq. (3)."""
        return FrictionCurve(self.Ts, self.tau1, self.tau2, self.C)

    def predict(self, time_s: Array) -> Array:
        """Output at times since the step [s], above the baseline: its start, and behind its dead time Eq. (3)."""
        return self.start + step_response(self.curve, np.maximum(time_s - self.delay_s, 0.0))


class Trend(Result, frozen=True):
    """A fitted value over stress or speed (Tables I and II)."""

    form: Literal["linear", "double-exponential", "merged-exponential"]
    coefficients: tuple[Number, ...]
    """[slope, offset]; [p, r1, q, r2] of p e^(r1 x) + q e^(r2 x); [p, q, r] of (p + q x) e^(r x)."""
    over: str = ""
    """stress_kpa, speed_rpm, or level_UNIT where the stress is not known."""
    rmse: Number | None = None
    converged: bool = True
    at_bounds: tuple[str, ...] = ()
    ci95: tuple[Interval, ...] | None = None

    def __post_init__(self) -> None:
        wanted = {"linear": 2, "merged-exponential": 3, "double-exponential": 4}[self.form]
        if len(self.coefficients) not in (0, wanted):
            raise ValueError(f"{len(self.coefficients)} coefficients, and a {self.form} trend has {wanted}")

    def predict(self, x: Array) -> Array:
        """The fitted value over stress or speed."""
        return evaluate(self.form, self.coefficients, x)


class Friction(Result, frozen=True):
    """Friction curves of all levels, and their trends."""

    C: Number | None = None
    """The share of the fast part that was held; None where it was free."""
    over: str = ""
    """What trends run over: stress_kpa, speed_rpm, or level_UNIT where the stress is not known."""
    levels: tuple[FrictionLevel, ...] = ()
    trends: dict[str, Trend] = {}
    solver: Solver | None = None
    identifiable: bool | None = None
    hold_out: HoldOut | None = None
    robust: Huber | None = None

    @property
    def over_stress(self) -> bool:
        """Whether trends run over the normal stress, which is known of every level."""
        return self.over == "stress_kpa" and all(row.stress_kpa is not None for row in self.levels)

    @property
    def x(self) -> tuple[float, ...]:
        """The levels in the quantity that trends run over."""
        key = self.over if self.over in ("stress_kpa", "speed_rpm") else "level"
        return tuple(getattr(one, key) for one in self.levels)


class ReleaseLevel(Scores, frozen=True):
    """T(t) = residual + amplitude (share e^(−t/τ1) + (1 − share) e^(−t/τ2)) after the release of one level."""

    level: Number
    share: Number | None = None
    tau1: Number | None = None
    tau2: Number | None = None
    rising_tau1: Number | None = None
    rising_tau2: Number | None = None
    amplitude: Number | None = None
    residual: Number | None = None
    """Output left after a long time."""
    solver: Solver | None = None


class Release(Result, frozen=True):
    """Time constants of the falling edges to rest: of all levels together, and of each."""

    tau1: Positive
    tau2: Positive
    C: Number = 0.85
    rmse: Number | None = None
    sse: Number | None = None
    levels: tuple[ReleaseLevel, ...] = ()
    solver: Solver | None = None
