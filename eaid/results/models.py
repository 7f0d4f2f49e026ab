"""The parts of a fit as types: each model with its errors and intervals, single steps, how sure, what was fitted."""

from typing import Annotated, Any, Literal

import msgspec
import numpy as np

from eaid.apparatus import Apparatus
from eaid.arrays import Array
from eaid.findings import Finding
from eaid.logs.units import UNKNOWN
from eaid.options import ExperimentKind
from eaid.plant.dynamics import Plant, Step
from eaid.plant.forms import refuse_unordered
from eaid.plant.linear import LinearPlant as LinearModel
from eaid.plant.steps import decay, step_response
from eaid.plant.trends import evaluate
from eaid.results.common import (
    AbsError,
    Count,
    HoldOut,
    Input,
    Interval,
    LevelError,
    LogReplayed,
    Number,
    Positive,
    Result,
    Scores,
    Share,
    Solver,
    Source,
)
from eaid.results.plant import Polynomial


class Intervals(Result, frozen=True, kw_only=True):
    """95 % intervals by parameter."""

    dof: dict[str, Number] = {}
    """Degrees of freedom of each, where they are known."""


class LevelIntervals(Intervals, frozen=True):
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
    def curve(self) -> Step:
        """The curve of Eq. (3)."""
        return Step(self.Ts, self.tau1, self.tau2, self.C)

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
    hold_out: HoldOut | None = None

    @property
    def over_stress(self) -> bool:
        """Whether trends run over the normal stress, which is known of every level."""
        return self.over == "stress_kpa" and all(row.stress_kpa is not None for row in self.levels)


class Release(Result, frozen=True):
    """Time constants of the falling edges to rest, of all levels together."""

    tau1: Positive
    tau2: Positive
    C: Number = 0.85
    rmse: Number | None = None
    sse: Number | None = None
    solver: Solver | None = None
    as_left: bool = False
    """Whether each level's own time constants explain its falls better than these do."""


class PooledIntervals(Intervals, frozen=True):
    """95 % intervals of the pooled linear model."""

    a0: Interval = None
    b0: Interval = None
    c0: Interval = None


class LinearLevelIntervals(Intervals, frozen=True):
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


class Linear(Scores, frozen=True):
    """Eq. (8) fitted to all levels at once, Ṫ = −a0 T + b0 u + c0, and each level's own."""

    a0: Number
    b0: Number
    c0: Number
    solver: Solver | None = None
    ci95: PooledIntervals | None = None
    per_level: tuple[LinearLevel, ...] = ()
    bounds: Bounds | None = None
    hold_out: HoldOut | None = None

    @property
    def parameters(self) -> LinearModel:
        """The model of Eq. (8)."""
        return LinearModel(self.a0, self.b0, self.c0)

    def to_control(self) -> Any:
        """The transfer function b0/(s + a0) from input to output, by python-control, where that is installed."""
        import control

        return control.tf([self.b0], [1.0, self.a0])


class CurveLevel(Result, frozen=True):
    """The nonlinear model's curves at one level."""

    level: Number
    Ts: Number | None = None
    tau1: Number | None = None
    tau2: Number | None = None
    ci95: LevelIntervals | None = None


class CoefficientIntervals(Result, frozen=True):
    """95 % intervals of the polynomials' coefficients."""

    tau1: tuple[Interval, ...] = ()
    tau2: tuple[Interval, ...] = ()
    Ts: tuple[Interval, ...] = ()
    C: Interval = None


class Covariance(Result, frozen=True):
    """Covariance of the coefficients of (u/100)^k, so that plants can be drawn."""

    order: tuple[str, ...] = ()
    matrix: tuple[tuple[Number, ...], ...] = ()
    degrees_of_freedom: dict[str, Number | None] = {}


class LevelsLeftOut(Result, frozen=True):
    """The model at levels between others, by fits that each of them was left out of in turn."""

    fit_pct: Number | None = None
    """What the model explains of these levels' curves …"""
    held_pct: Number | None = None
    """… and what the fits without them do."""
    Ts_off_pct: Number | None = None
    """Distance of T_s to the level's own, of the middle one of the levels."""
    worst: Number | None = None
    """Level of the largest distance."""
    worst_off_pct: Number | None = None


class Nonlinear(Scores, frozen=True):
    """The ten coefficients of Eqs. (4)–(7)."""

    tau1: Polynomial
    tau2: Polynomial
    Ts: Polynomial
    u_range: tuple[Annotated[float, msgspec.Meta(ge=0, le=1e60)], Positive]
    """Lowest and highest identified input."""
    C: Share = 0.85
    C_free: bool = False
    Ts_through: tuple[tuple[Number, Number], ...] = ()
    """Inputs and values that T_s(u) goes through in place of `Ts`; empty: it is the polynomial."""
    abs_error: AbsError | None = None
    per_level: tuple[LevelError, ...] = ()
    solver: Solver | None = None
    curves: tuple[CurveLevel, ...] = ()
    ci95: CoefficientIntervals | None = None
    covariance: Covariance | None = None
    misfit: dict[str, Number | None] | None = None
    """χ² of the levels' T_s, τ1, τ2 about their polynomials, over levels − coefficients."""
    level_scatter: Number | None = None
    """Standard deviation of the levels' T_s about the curve, beyond what their runs explain, as a share."""
    hold_out: HoldOut | None = None
    left_out: LevelsLeftOut | None = None
    estimator: Literal["levels-first", "joint"] = "joint"
    """Which estimate this is: one T_s a level first and T_s(u) through them, or all at once as in the paper."""
    joint: "Nonlinear | None" = None
    """Beside the estimate that is used the paper's joint fit, without intervals."""

    def __post_init__(self) -> None:
        refuse_unordered(self.Ts_through)

    @property
    def through_levels(self) -> bool:
        """Whether T_s(u) goes through the value of each level."""
        at = [u for u, _ in self.Ts_through]
        return bool(at) and at == [row.level for row in self.per_level]

    @property
    def parameters(self) -> Plant:
        """The model of Eqs. (4)–(7)."""
        return Plant(self.tau1, self.tau2, self.Ts, self.u_range, self.C, Ts_through=self.Ts_through)


class Noise(Result, frozen=True):
    """What drawn runs and planned recordings rest on."""

    sensor_nm2_s: Annotated[float, msgspec.Meta(ge=0, le=1e60)] = 0.0
    """Density of the sensor's noise [output²·s]."""
    ripple_s: Annotated[float, msgspec.Meta(ge=0, le=1e60)] = 0.0
    """Density of the ripple relative to the output [s]."""
    scatter: dict[str, Number] = {}
    """Standard deviation from run to run of T_s, τ1, τ2, as a share."""


class ShareEstimate(Result, frozen=True):
    """The share C that was held, and the one that the runs ask for."""

    held: Number | None = None
    change_per_001_pct: dict[str, Number] = msgspec.field(default_factory=dict, name="per_0.01_pct")
    """Change of T_s, τ1, τ2 [%] if C were larger by 0.01."""
    estimate: Number | None = None
    ci95: Interval = None
    degrees_of_freedom: Number | None = None
    rejected: bool | None = None
    matters: bool | None = None


class LackOfFit(Result, frozen=True):
    """A level's misfit against the spread of its repeats."""

    level: Number
    ratio: Number | None = None
    chance: Number | None = None
    beyond: bool = False
    systematic_nm: Number | None = None


class Uncertainty(Result, frozen=True):
    """Where the intervals come from."""

    ci: str = "none"
    scatter_from: str = ""
    """repeats, curve, or within."""
    degrees_of_freedom: Number | None = None
    noise: Noise | None = None
    draws: Count | None = None
    share: ShareEstimate | None = None
    lack_of_fit: tuple[LackOfFit, ...] = ()


class StepIntervals(Result, frozen=True):
    """95 % intervals of one step; null where the record says nothing of use, or where it was given."""

    change: Interval = None
    gain: Interval = None
    tau1: Interval = None
    tau2: Interval = None
    C: Interval = None
    dead_time_s: Interval = None


class StepShape(Result, frozen=True):
    """The response of one step, in the units of its step set."""

    run: str
    from_: Number = msgspec.field(name="from")
    """Input before the step."""
    level: Number
    """Input after it."""
    edge: str
    """up or down."""
    start: Number
    """Output before the step, where the hold before would have settled."""
    change: Number
    """Steady output less the start."""
    gain: Number | None
    """Change of output over change of input."""
    shape: str
    tau1: Positive
    """Fast time constant [s]; the only one of the shape "one"."""
    tau2: Positive | None
    """Slow time constant [s]."""
    C: Number
    """Fast share; 1 of the shape "one", above 1 of "overshoot"."""
    dead_time_s: Number
    rmse: Number
    fit_pct: Number | None
    """100 (1 − ‖y − ŷ‖/‖y − mean y‖)"""
    R2: Number | None
    samples: Count
    peak: Number | None = None
    """Largest change of an overshoot, from which it decays to `change`; None: it never comes down."""
    ci95: StepIntervals = StepIntervals()
    """From the noise of this one record: how much steps differ from one another is not in it."""
    tail: tuple[tuple[Number, Number], ...] = ()
    """What the steps before it have left to go: size at this step and time constant [s] of each part."""
    evidence: dict[str, Number | None] = {}
    """AICc of each shape less that of the best; shapes with a dead time are named `one+dead` and so on."""
    findings: tuple[Finding, ...] = ()

    def predict(self, time_s: Array) -> Array:
        """Output at times since the step [s]."""
        at = Step(self.change, self.tau1, self.tau1 if self.tau2 is None else self.tau2, self.C)
        left = sum((size * decay(time_s, tau) for size, tau in self.tail), np.zeros_like(time_s))
        return np.asarray(self.start + left + step_response(at, np.maximum(time_s - self.dead_time_s, 0.0)))


class CreepFound(Result, frozen=True):
    """A creep of the output beside its response, or in proportion to it, of all runs, which the fit is without."""

    rate: Number = 0.0
    """[output/s]; in proportion, [1/s]"""
    ci95: Interval = None
    t0_s: Number = 0.0
    """How long before a step it is 0: in the middle of the idle time [s]."""
    in_proportion: bool = False
    """The response itself grows, or fades, while it is held: y(t) = f(t) (1 + rate · t)."""


class FittedData(Result, frozen=True):
    """What was fitted."""

    kind: ExperimentKind = "clutch"
    input_unit: str = "%"
    output_unit: str = "N·m"
    levels: tuple[Number, ...] = ()
    repeats: tuple[Count, ...] = ()
    samples: tuple[Count, ...] = ()
    record_s: tuple[Number, ...] = ()
    """Length of each level's record [s]."""
    sample_rate_hz: Positive | None = None
    apparatus: Apparatus | None = None
    """None: the sizes of the rig are not known."""
    sources: tuple[Source, ...] = ()
    creep: CreepFound | None = None
    replayed: tuple[LogReplayed, ...] = ()
    """Of logs whose input was recorded and is held."""
    inputs: tuple[Input, ...] = ()
    synthetic: str | None = None
    """What made the data, where no rig did."""

    def __post_init__(self) -> None:
        for name in ("input_unit", "output_unit"):
            if not getattr(self, name):  # of files that were written before an unknown unit was called arbitrary
                msgspec.structs.force_setattr(self, name, UNKNOWN)
