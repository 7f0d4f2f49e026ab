"""fit.json as types: what was fitted, how well, how sure, and what to be warned of.

Keys are the paper's symbols, polynomials lowest power first, units those of the rig (`data.input_unit`,
`data.output_unit`); time constants in s. Files are written, with the version of their schema, by `results/codec.py`.
"""

import math
from bisect import bisect
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from statistics import median_low
from typing import TYPE_CHECKING, Any, ClassVar

import msgspec
import numpy as np
from scipy.special import stdtrit

from eaid.arrays import Array
from eaid.errors import DataError, UsageError, in_python
from eaid.findings.row import SYMBOLS
from eaid.options import FitOptions
from eaid.plant import linear
from eaid.plant.dynamics import Plant
from eaid.plant.forms import terms
from eaid.plant.respond import from_rest
from eaid.results import codec, models, statistics
from eaid.results.common import Made, Number, Result, Samples
from eaid.results.plant import FittedPlant, falls_between, with_release
from eaid.results.recorded import LogFit, Recorded
from eaid.results.responses import LevelResponse
from eaid.shown import Plotted, pandas

if TYPE_CHECKING:
    from eaid.results.verdict import Verdict


AS_PRINTED = 1e-4  # Part of an input within which it is that of the table
ENDS_MEASURED = 2e-3  # Part of the largest input by which one may lie beyond the ends that were measured


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


# What predicts a step from rest
MODEL_CURVES: dict[str, Any] = {
    "nonlinear": from_rest, "linear": linear.linear_response, "friction": None, "plant": from_rest,
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class FitGiven(FitOptions):
    """All that a fit was given, the reading of its logs too, so that it can be done again."""

    reading: dict[str, str | float | bool | None] = field(default_factory=dict)


def _is_within_known(u: float, known: Sequence[float]) -> bool:
    """Whether an input lies within those that are known, or next to them by what measured ones are off."""
    play = ENDS_MEASURED * max(known)
    return min(known) - play <= u <= max(known) + play


class Fit(Plotted, codec.Saved, Made, frozen=True):
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
    data: models.FittedData = models.FittedData()
    converged: bool | None = None
    friction: models.Friction | None = None
    nonlinear: models.Nonlinear | None = None
    linear: models.Linear | None = None
    release: models.Release | None = None
    plant_: FittedPlant | None = msgspec.field(default=None, name="plant")
    uncertainty: models.Uncertainty | None = None
    steps: tuple[models.StepShape, ...] = ()
    """Each change of input between two holds by itself, where a log goes from level to level."""
    recorded: Recorded | None = None
    """Of logs that were fitted as they were recorded."""
    responses: tuple[LevelResponse, ...] = ()
    """How the output of each level comes, stays and goes, as recorded."""
    parameters: tuple[Parameter, ...] = ()
    """All fitted parameters with their intervals."""
    samples: Samples = Samples()
    """The steps that it was fitted to; none where it was read from a file."""

    @property
    def params(self) -> "pandas.Series[float]":
        """All fitted parameters, indexed by (model, parameter)."""
        values = statistics.interval_columns(self.parameters)[0]
        return pandas.Series(values, index=statistics.index_of(self.parameters), name="value", dtype=float)

    def conf_int(self, alpha: float = 0.05) -> "pandas.DataFrame":
        """Intervals of `params` that miss with probability `alpha`, columns low and high; NaN where there are none.

        Those of another confidence than 95 % by Student's t, on the logarithm where the 95 % interval is even there.
        """
        if not 0 < statistics.as_numbers("alpha", alpha, 0) < 1:
            raise UsageError(f"«alpha» {alpha}: must lie between 0 and 1")
        value, low, high, dof = statistics.interval_columns(self.parameters)
        ends = np.array([low, high])
        if alpha != 0.05:
            ratio = stdtrit(dof, 1 - alpha / 2) / stdtrit(dof, 0.975)
            with np.errstate(invalid="ignore", divide="ignore"):
                scaled = value * (ends / value) ** ratio
                ends = np.where(statistics.by_ratio(value, low, high), scaled, value + ratio * (ends - value))
        return pandas.DataFrame(ends.T, index=statistics.index_of(self.parameters), columns=["low", "high"])

    @property
    def bse(self) -> "pandas.Series[float]":
        """Standard errors of `params`: half of each 95 % interval over Student's t; NaN where there is none.

        Where an interval is even on the logarithm, that of the logarithm times the value.
        """
        value, low, high, dof = statistics.interval_columns(self.parameters)
        with np.errstate(invalid="ignore", divide="ignore"):
            width = np.where(statistics.by_ratio(value, low, high), value * np.log(high / low), high - low)
        index = statistics.index_of(self.parameters)
        return pandas.Series(width / (2 * stdtrit(dof, 0.975)), index=index, name="bse", dtype=float)

    def cov_params(self) -> "pandas.DataFrame":
        """Covariance of the nonlinear model's coefficients, of powers of the input; `DataError` where there is none."""
        held = self.nonlinear.covariance if self.nonlinear is not None else None
        if held is None or not held.matrix:
            raise DataError(
                "the fit holds no covariance; fit steps of several levels with «model» nonlinear, «ci» robust"
            )
        powers = np.array([int(name.partition("[")[2].rstrip("]") or 0) for name in held.order])
        per_unit = 100.0**-powers  # kept in powers of u/100, given as those of u
        rows = [("nonlinear", name) for name in held.order]
        names = pandas.MultiIndex.from_tuples(rows, names=["model", "parameter"])
        return pandas.DataFrame(np.array(held.matrix) * np.outer(per_unit, per_unit), index=names, columns=names)

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
        """T_s, τ1 and τ2 at an input, with the ends of their 95 % intervals: columns value, low, high; of a plant of
        another kind its end there and what it is known by.

        `UsageError` outside the identified range; between levels the nonlinear model's curves.
        """
        level = float(statistics.as_numbers("level", level, 0))
        shown = [row.level for row in self.parameters if row.level is not None]
        near = min(shown, key=lambda one: abs(one - level), default=level)
        level = near if math.isclose(near, level, rel_tol=AS_PRINTED) else level
        rows = {row.name: row for row in self.parameters if row.level is not None and math.isclose(row.level, level)}
        p, other = self.nonlinear, self.another_plant if self.nonlinear is None else None
        part, signed = p or other, other is not None and other.plant.signed
        found: dict[str, tuple[float | None, ...]]
        if other is None and rows.keys() >= SYMBOLS.keys():
            found = {name: (rows[name].value, rows[name].low, rows[name].high) for name in SYMBOLS}
        elif part is None or not _is_within_known(abs(level) if signed else level, part.u_range):
            inside = "" if part is not None else "the levels "
            raise self._outside("level", level, self.data.levels if part is None else part.u_range, inside)
        elif isinstance(part, FittedPlant):
            found = {name: (value, *(ends or (None, None))) for name, (value, ends) in part.at(level).items()}
        else:
            values = (part.parameters.steady(level), *part.parameters.time_constants(level))
            known = zip(SYMBOLS, map(float, values), strict=True)
            found = {name: self._on_curve(part, name, value, level) for name, value in known}
        return pandas.DataFrame.from_dict(found, orient="index", columns=["value", "low", "high"], dtype=float)

    def _on_curve(self, p: models.Nonlinear, name: str, value: float, level: float) -> tuple[float, float, float]:
        """A value of a polynomial and its 95 % interval, on its logarithm, by the covariance of the coefficients; no
        narrower than at the inputs of the table to both sides, and none where these have none."""
        rows = sorted(p.curves, key=lambda row: row.level)
        place = bisect(rows, level, key=lambda row: row.level)
        beside = rows[max(place - 1, 0) : place + 1]
        known = [(getattr(row, name), ends) for row in beside if (ends := getattr(row.ci95, name, None)) is not None]
        if p.covariance is None or not p.covariance.matrix or not value > 0 or len(known) < len(beside):
            return value, math.nan, math.nan
        places = [k for k, key in enumerate(p.covariance.order) if key.partition("[")[0] == name]
        g = terms(level, len(places), p.u_range)[0] / value
        variance = max(float(g @ np.array(p.covariance.matrix)[np.ix_(places, places)] @ g), 0.0)
        dof = p.covariance.degrees_of_freedom.get(name)
        if name == "Ts" and p.level_scatter:  # a level lies off the curve by so much
            variance += p.level_scatter**2
        reach = float(stdtrit(dof or 1e12, 0.975)) * math.sqrt(variance)
        low = min([-reach, *(math.log(ends[0] / own) for own, ends in known)])
        high = max([reach, *(math.log(ends[1] / own) for own, ends in known)])
        return value, value * math.exp(low), value * math.exp(high)

    def _outside(self, name: str, value: float, known: Sequence[float], inside: str = "") -> UsageError:
        ends = f"{inside}{min(known):g} … {max(known):g} {self.data.input_unit}".rstrip()
        return UsageError(f"«{name}» {value:g}: the fit knows {ends} only")

    @property
    def residuals(self) -> "pandas.Series[float]":
        """Recorded less fitted, indexed by (level, time_s): of a level's mean of repeats against the first model; of
        logs that were fitted as recorded by (log, time_s), against the plant.

        `DataError` for a fit that was read from a file: it holds no samples.
        """
        both = statistics.residuals(self)
        return (both["recorded"] - both["fitted"]).rename("residual")

    resid = residuals

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
        index = pandas.Index([u for _, u in rows], name="level", dtype=float)
        return pandas.DataFrame(list(rows.values()), index=index)

    def predict(
        self, duty: float | Sequence[float], t: float | Sequence[float], model: str | None = None
    ) -> "pandas.DataFrame":
        """The output after a step from rest to each input.

        Parameters
        ----------
        duty : float or sequence of floats
            Inputs, in the input's unit.
        t : float or sequence of floats, shape (n,)
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
        chosen = model or statistics.first_model(self)
        if chosen not in MODEL_CURVES:
            raise UsageError(f"«model» {chosen}: must be one of {', '.join(MODEL_CURVES)}")
        if (self.plant_ if chosen == statistics.PLANT else getattr(self, chosen)) is None:
            raise DataError(f"the fit holds no {chosen} model; fit one, or choose another «model»")
        time_s = np.atleast_1d(statistics.as_numbers("t", t))
        inputs = np.atleast_1d(statistics.as_numbers("duty", duty)).tolist()
        known = self.data.levels if self.recorded is None else self.recorded.u_range
        signed = chosen == statistics.PLANT and bool(self.plant.Ts_below)
        for u in inputs:
            if known and not _is_within_known(abs(u) if signed else u, known):
                raise self._outside("duty", u, known)
        return pandas.DataFrame(
            np.column_stack([self.curve(chosen, u, np.maximum(time_s, 0.0)) for u in inputs]),
            index=pandas.Index(time_s, name="time_s"),
            columns=pandas.Index(inputs, name=f"{chosen} [{self.data.input_unit}]"),
        )

    def curve(self, model: str, duty: float, time_s: Array) -> Array:
        """The output of a model at times since a step from rest."""
        if model == statistics.PLANT:
            return from_rest(self.plant, time_s, duty)
        if model != "friction":
            acting_s = np.maximum(time_s - self.dead_time_s, 0.0)
            return np.asarray(MODEL_CURVES[model](getattr(self, model).parameters, acting_s, duty))
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
    def another_plant(self) -> FittedPlant | None:
        """The plant where evidence asked for another kind than the clutch's."""
        return self.plant_ if self.plant_ is not None and self.plant_.another else None

    @property
    def logs(self) -> tuple[LogFit, ...]:
        """The logs that were fitted as recorded."""
        return self.recorded.logs if self.recorded is not None else ()

    @property
    def falls_recorded(self) -> bool:
        """Whether falls from one identified input to another were fitted, as steps or in a log as recorded."""
        sizes = [np.abs(log.curve.input) for log in self.logs]
        fell = any(((u[1:] < u[:-1]) & (u[1:] >= self.plant.u_range[0])).any() for u in sizes)
        return fell or bool(falls_between(self.friction_levels))

    @property
    def friction_levels(self) -> tuple[models.FrictionLevel, ...]:
        """The friction curves of levels, and of steps between them; none where they were not fitted."""
        return self.friction.levels if self.friction is not None else ()

    @property
    def level_values(self) -> tuple[models.CurveLevel, ...] | tuple[models.FrictionLevel, ...]:
        """T_s, τ1 and τ2 by level: each level's own, or the nonlinear model's where those were not asked for."""
        own = tuple(row for row in self.friction_levels if row.from_ == 0)
        return own or (self.nonlinear.curves if self.nonlinear is not None else ())

    @property
    def on_tails(self) -> bool:
        """Whether its steps began on what those before had left, which was taken off."""
        return any(one.code == "tails-taken-off" for one in self.findings)

    @property
    def turned(self) -> bool:
        """Whether its output counts with its sign turned."""
        return any(one.code == "signs-turned" for one in self.findings)

    @property
    def noted_late_s(self) -> float:
        """By how much the inputs of its steps were noted late [s]; it takes them as they acted."""
        return next((float(one.values["ms"]) / 1e3 for one in self.findings if one.code == "input-late"), 0.0)  # type: ignore[arg-type]

    @property
    def dead_time_s(self) -> float:
        """Dead time [s]: the plant's; without one of logs as recorded, or the median of single steps upwards."""
        if self.plant_ is not None:
            return self.plant_.dead_time_s
        if self.recorded is not None:
            return self.recorded.dead_time_s
        return median_low([step.dead_time_s for step in self.steps if step.edge == "up"] or [0.0])

    @property
    def latest_dead_time_s(self) -> float:
        """Upper end of the dead time's interval [s], for which loops are designed; the dead time where it has none."""
        known = None if self.plant_ is None or self.plant_.ci95 is None else self.plant_.ci95.dead_time_s
        return self.dead_time_s if known is None else max(self.dead_time_s, known[1])

    @property
    def of_sessions(self) -> bool:
        """Whether its intervals are those of the next session, by `eaid.today`, not of one mounting."""
        return self.uncertainty is not None and self.uncertainty.ci == "sessions"

    @property
    def verdict(self) -> "Verdict":
        """Whether it may be used, and why not: `usable`, `reasons`, `why`; `of("linear")` is that on one model."""
        from eaid.results.verdict import verdict_of

        return verdict_of(self)
