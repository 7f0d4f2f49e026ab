"""fit.json as types: what was fitted, how well, how sure, and what to be warned of.

Keys are the paper's symbols, polynomials lowest power first, units those of the rig (`data.input_unit`,
`data.output_unit`); time constants in s. Files are written, with the version of their schema, by `results/codec.py`.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from statistics import median_low
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import msgspec
import numpy as np
from scipy.special import stdtrit

from eaid.apparatus import Apparatus
from eaid.arrays import Array
from eaid.errors import DataError, UsageError, in_python
from eaid.findings import Finding
from eaid.findings.row import SYMBOLS
from eaid.options import ExperimentKind, FitGiven
from eaid.plant import linear
from eaid.plant.dynamics import Plant, Step
from eaid.plant.forms import terms
from eaid.plant.linear import Linear as LinearModel
from eaid.plant.respond import from_rest, step_response
from eaid.plant.trends import evaluate
from eaid.results import codec, statistics
from eaid.results.common import (
    AbsError,
    Count,
    HoldOut,
    Input,
    Interval,
    LevelError,
    Made,
    Number,
    Positive,
    Result,
    Scores,
    Share,
    Solver,
    Source,
)
from eaid.results.plant import Coefficients, FittedPlant, falls_between, with_release
from eaid.results.recorded import LogFit, Recorded
from eaid.results.responses import LevelResponse
from eaid.shown import Plotted

if TYPE_CHECKING:
    import pandas

    from eaid.results.verdict import Verdict


class Parameter(Result, frozen=True):
    """One fitted parameter: the row from which tables, frames and the keys `ci95` are made."""

    model: str
    name: str
    """The symbol; of a polynomial's or a trend's coefficients with the power or place, as `tau1[2]`."""
    level: Number | None = None
    """None: it belongs to all levels."""
    value: Number | None = None
    low: Number | None = None
    """Least value of the 95 % interval; None where the data say nothing of use."""
    high: Number | None = None
    dof: Number | None = None
    """Degrees of freedom of the interval."""
    why: str = ""
    """Code of the finding that says why there is no interval."""


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

    tau1: Coefficients
    tau2: Coefficients
    Ts: Coefficients
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
    """χ² of the levels' T_s, τ1, τ2 about their polynomials, over levels − coefficients."""
    level_scatter: Number | None = None
    """Standard deviation of the levels' T_s about the curve, beyond what their runs explain, as a share."""
    hold_out: HoldOut | None = None
    left_out: LevelsLeftOut | None = None
    estimator: Literal["levels-first", "joint"] = "joint"
    """Which estimate this is: one T_s a level first and T_s(u) through them, or all at once as in the paper."""
    joint: "Nonlinear | None" = None
    """Beside the estimate that is used the paper's joint fit, without intervals."""

    @property
    def parameters(self) -> Plant:
        """The model of Eqs. (4)–(7)."""
        return Plant(self.tau1, self.tau2, self.Ts, self.u_range, self.C)


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
        after = np.maximum(time_s - self.dead_time_s, 0.0)
        slow = 0.0 if self.tau2 is None else (1 - self.C) * np.exp(-after / self.tau2)
        left = sum((size * np.exp(-time_s / tau) for size, tau in self.tail), np.zeros_like(after))
        return np.asarray(self.start + left + self.change * (1 - self.C * np.exp(-after / self.tau1) - slow))


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
    inputs: tuple[Input, ...] = ()
    synthetic: str | None = None
    """What made the data, where no rig did."""


# What predicts a step from rest
CURVES: dict[str, Any] = {"nonlinear": from_rest, "linear": linear.step_response, "friction": None, "plant": from_rest}


class Fit(Plotted, codec.Saved, Made, frozen=True, dict=True):
    """All that one call fitted; what its kind does not allow is None.

    Examples
    --------
    >>> import eaid
    >>> fit = eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1))
    >>> fit.predict(duty=[60.0, 100.0], t=[0.0, 1.0, 10.0]).shape
    (3, 2)
    >>> fit.linear.bounds.B_m < fit.linear.bounds.B_M
    True
    """

    FILE: ClassVar[str] = "fit"
    options: FitGiven = FitGiven()
    data: FittedData = FittedData()
    converged: bool | None = None
    friction: Friction | None = None
    nonlinear: Nonlinear | None = None
    linear: Linear | None = None
    release: Release | None = None
    plant_: FittedPlant | None = msgspec.field(default=None, name="plant")
    uncertainty: Uncertainty | None = None
    steps: tuple[StepShape, ...] = ()
    """Each change of input between two holds by itself, where a log goes from level to level."""
    recorded: Recorded | None = None
    """Of logs that were fitted as they were recorded."""
    responses: tuple[LevelResponse, ...] = ()
    """How the output of each level comes, stays and goes, as recorded."""
    parameters: tuple[Parameter, ...] = ()
    """All fitted parameters with their intervals."""

    @property
    def params(self) -> "pandas.Series[float]":
        """All fitted parameters, indexed by (model, parameter)."""
        import pandas as pd

        values = [np.nan if row.value is None else row.value for row in self.parameters]
        return pd.Series(values, index=statistics.index_of(self.parameters), name="value", dtype=float)

    def conf_int(self, alpha: float = 0.05) -> "pandas.DataFrame":
        """Intervals of `params` that miss with probability `alpha`, columns low and high; NaN where there are none.

        Those of another confidence than 95 % by Student's t, on the logarithm where the 95 % interval is even there.
        """
        return statistics.intervals(self.parameters, alpha)

    @property
    def bse(self) -> "pandas.Series[float]":
        """Standard errors of `params`: half of each 95 % interval over Student's t; NaN where there is none.

        Where an interval is even on the logarithm, that of the logarithm times the value.
        """
        return statistics.standard_errors(self.parameters)

    def cov_params(self) -> "pandas.DataFrame":
        """Covariance of the nonlinear model's coefficients, of powers of the input; `DataError` where there is none."""
        return statistics.covariance(self)

    @property
    def nobs(self) -> int:
        """Samples that the first model was fitted to: of each level those of the average of its repeats."""
        return statistics.sums(self)[2]

    @property
    def rsquared(self) -> float:
        """1 − ‖y − ŷ‖²/‖y − mean y‖² of the first model; of friction curves each about its own mean."""
        sse, about_mean, _ = statistics.sums(self)
        return 1 - sse / about_mean

    @property
    def aic(self) -> float:
        """2 k − 2 log L of the first model, as if samples were independent: for models of the same logs."""
        return 2 * statistics.free_parameters(self) - 2 * statistics.log_likelihood(self)

    @property
    def bic(self) -> float:
        """k log n − 2 log L of the first model, as if samples were independent."""
        return statistics.free_parameters(self) * math.log(self.nobs) - 2 * statistics.log_likelihood(self)

    @property
    def levels(self) -> tuple[float, ...]:
        """The levels that were fitted, in the input's unit."""
        return self.data.levels

    def at(self, level: float) -> "pandas.DataFrame":
        """T_s, τ1 and τ2 at an input, with the ends of their 95 % intervals: columns value, low, high.

        `UsageError` outside the identified range; between levels the nonlinear model's curves.
        """
        import pandas as pd

        rows = {row.name: row for row in self.parameters if row.level is not None and math.isclose(row.level, level)}
        p = self.nonlinear
        if rows.keys() >= SYMBOLS.keys():
            found = [(rows[name].value, rows[name].low, rows[name].high) for name in SYMBOLS]
        elif p is None or not p.u_range[0] <= level <= p.u_range[1]:
            inside = "" if p is not None else "the levels "
            raise self._outside("level", level, self.data.levels if p is None else p.u_range, inside)
        else:
            values = (p.parameters.steady(level), *p.parameters.time_constants(level))
            found = [self._on_curve(p, *pair, level) for pair in zip(SYMBOLS, map(float, values), strict=True)]
        return pd.DataFrame(found, index=list(SYMBOLS), columns=["value", "low", "high"], dtype=float)

    def _on_curve(self, p: Nonlinear, name: str, value: float, level: float) -> tuple[float, float, float]:
        """A value of a polynomial and its 95 % interval, on its logarithm, by the covariance of the coefficients."""
        if p.covariance is None or not p.covariance.matrix or not value > 0:
            return value, math.nan, math.nan
        places = [k for k, key in enumerate(p.covariance.order) if key.partition("[")[0] == name]
        g = terms(level, len(places), p.u_range)[0] / value
        variance = float(g @ np.array(p.covariance.matrix)[np.ix_(places, places)] @ g)
        dof = p.covariance.degrees_of_freedom.get(name)
        if name == "Ts" and p.level_scatter:  # a level lies off the curve by so much
            variance += p.level_scatter**2
        reach = float(stdtrit(dof or 1e12, 0.975)) * math.sqrt(variance)
        return value, value * math.exp(-reach), value * math.exp(reach)

    def _outside(self, name: str, value: float, known: Sequence[float], inside: str = "") -> UsageError:
        ends = f"{inside}{min(known):g} … {max(known):g} {self.data.input_unit}".rstrip()
        return UsageError(f"«{name}» {value:g}: the fit knows {ends} only")

    @property
    def residuals(self) -> "pandas.Series[float]":
        """Recorded less fitted, indexed by (level, time_s): of the mean of a level's repeats against the first model.

        `DataError` for a fit that was read from a file: it holds no samples.
        """
        both = statistics.residuals(self)
        return (both["recorded"] - both["fitted"]).rename("residual")

    @property
    def resid(self) -> "pandas.Series[float]":
        """`residuals`."""
        return self.residuals

    @property
    def fittedvalues(self) -> "pandas.Series[float]":
        """The first model at the samples of `residuals`."""
        return statistics.residuals(self)["fitted"]

    @property
    def rmse(self) -> float:
        """Root mean square residual of the model that the fit stands for; NaN if unknown."""
        sse, _, samples = statistics.sums(self)
        return math.sqrt(sse / max(samples, 1))

    def to_frame(self) -> "pandas.DataFrame":
        """One row a level, or a step between two: its curve with intervals, and the error of each model."""
        import pandas as pd

        rows: dict[tuple[float, float], dict[str, Any]] = {}
        for one in self.friction_levels:
            rows[one.from_, one.level] = {key: cell for key, cell in codec.cells_of(one).items() if key != "level"}
        for name in ("nonlinear", "linear"):
            part = getattr(self, name)
            for error in part.per_level if part is not None else ():
                cells = {f"{name}_rmse": error.rmse, f"{name}_fit_pct": error.fit_pct}
                if name == "linear":
                    cells |= {"a0": error.a0, "gain": error.gain, "B": error.B}
                level_row = rows.setdefault((0.0, error.level), {})
                level_row |= {key: np.nan if value is None else value for key, value in cells.items()}
        return pd.DataFrame(list(rows.values()), index=pd.Index([u for _, u in rows], name="level", dtype=float))

    def predict(
        self, duty: float | Sequence[float], t: Sequence[float], model: str | None = None
    ) -> "pandas.DataFrame":
        """The output after a step from rest to each input.

        Parameters
        ----------
        duty : float or sequence of floats
            Inputs, in the input's unit.
        t : sequence of floats, shape (n,)
            Times since the step [s]; before it the output is at rest.
        model : {"plant", "nonlinear", "linear", "friction"}, optional
            By default the plant where it is of another kind than the clutch's, else the first of the others that was
            fitted. The friction model knows its own levels only.

        Returns
        -------
        DataFrame, shape (n, inputs)
            The output in its own unit, time as the index, inputs as columns.

        Raises
        ------
        UsageError
            An input outside the fitted range, of which the data say nothing.
        """
        import pandas as pd

        chosen = model or statistics.first_model(self)
        if chosen not in CURVES:
            raise UsageError(f"«model» {chosen}: must be one of {', '.join(CURVES)}")
        if (self.plant_ if chosen == statistics.PLANT else getattr(self, chosen)) is None:
            raise DataError(f"the fit holds no {chosen} model; fit one, or choose another «model»")
        time_s, inputs = np.asarray(t, dtype=np.float64), np.atleast_1d(np.asarray(duty, dtype=np.float64)).tolist()
        known = self.data.levels if self.recorded is None else self.recorded.u_range
        for u in inputs:
            if known and not min(known) <= u <= max(known):
                raise self._outside("duty", u, known)
        return pd.DataFrame(
            np.column_stack([self.curve(chosen, u, np.maximum(time_s, 0.0)) for u in inputs]),
            index=pd.Index(time_s, name="time_s"),
            columns=pd.Index(inputs, name=f"{chosen} [{self.data.input_unit}]"),
        )

    def curve(self, model: str, duty: float, time_s: Array) -> Array:
        """The output of a model at times since a step from rest."""
        if model == statistics.PLANT:
            return from_rest(self.plant, time_s, duty)
        if model != "friction":
            acting_s = np.maximum(time_s - self.dead_time_s, 0.0)
            return np.asarray(CURVES[model](getattr(self, model).parameters, acting_s, duty))
        known = {row.level: row for row in self.friction_levels if row.from_ == 0}
        near = next((level for level in known if math.isclose(level, duty, rel_tol=1e-5)), None)
        if near is None:
            levels = ", ".join(f"{row.level:g}" for row in self.friction_levels)
            raise UsageError(f"«duty» {duty:g}: the friction model knows the levels {levels} only")
        return known[near].predict(time_s)

    def summary(self) -> str:
        """The fit in a few lines: fit %, T_s, τ1, τ2 with intervals, which estimate was taken, warnings."""
        from eaid.results.summary import fit_summary

        return in_python("\n".join(fit_summary(self)))

    @property
    def plant(self) -> Plant:
        """The one plant, which replays, margins, walls, plans and exports read; `DataError` where none was fitted.

        Of a file that holds none: the nonlinear model, with the release where falls to rest were fitted.
        """
        if self.plant_ is not None:
            return self.plant_.plant
        if self.nonlinear is None:
            raise DataError("this fit holds no nonlinear model; fit clutch logs with «model» nonlinear")
        plant = with_release(self.nonlinear.parameters, self.release, self.friction_levels)
        return replace(plant, dead_time_s=self.dead_time_s)

    @property
    def logs(self) -> tuple[LogFit, ...]:
        """The logs that were fitted as recorded."""
        return self.recorded.logs if self.recorded is not None else ()

    @property
    def recorded_falls(self) -> tuple[FrictionLevel, ...]:
        """The fitted steps that fall from one level to another, not to rest."""
        return falls_between(self.friction_levels)

    @property
    def friction_levels(self) -> tuple[FrictionLevel, ...]:
        """The friction curves of levels, and of steps between them; none where they were not fitted."""
        return self.friction.levels if self.friction is not None else ()

    @property
    def level_values(self) -> tuple[CurveLevel, ...] | tuple[FrictionLevel, ...]:
        """T_s, τ1 and τ2 by level: each level's own, or the nonlinear model's where those were not asked for."""
        own = tuple(row for row in self.friction_levels if row.from_ == 0)
        return own or (self.nonlinear.curves if self.nonlinear is not None else ())

    @property
    def dead_time_s(self) -> float:
        """Dead time [s]: the plant's; without one of logs as recorded, or the median of single steps upwards."""
        if self.plant_ is not None:
            return self.plant_.dead_time_s
        if self.recorded is not None:
            return self.recorded.dead_time_s
        return median_low([step.dead_time_s for step in self.steps if step.edge == "up"] or [0.0])

    @property
    def verdict(self) -> "Verdict":
        """Whether it may be used, and why not: `usable`, `reasons`, `why`; `of("linear")` is that on one model."""
        from eaid.results.verdict import verdict_of

        return verdict_of(self)
