"""The friction model: the curve of every level, the coefficient of friction by Eq. (1), and trends, SPEC §3."""

from collections.abc import Sequence

import numpy as np

from eaid.apparatus import Apparatus
from eaid.arrays import Array
from eaid.errors import DataError
from eaid.fitting.result import FrictionFit, LevelFit, Solver, Trend
from eaid.fitting.trends import LEAST, fit_trend
from eaid.steps.stepset import StepSet

PRESSURE_KPA: dict[str, float] = {"Pa": 1e-3, "kPa": 1.0, "MPa": 1e3, "bar": 100.0, "mbar": 0.1}
"""Units of an input that is a stress already."""
TORQUE_UNITS = ("N·m", "Nm", "N.m", "N*m")
FORMS_OVER: dict[str, dict[str, str]] = {
    "friction-force": {
        "Ts": "linear",
        "tau1": "double-exponential",
        "tau2": "double-exponential",
        "C_f": "double-exponential",
    },
    "friction-speed": {"Ts": "double-exponential", "tau1": "double-exponential", "tau2": "double-exponential"},
}
"""Which value has which trend in which experiment, Tables I and II."""


def trend_axis(stepset: StepSet, levels: Array) -> tuple[str, Array]:
    """What the trends run over, and the levels in it: stress [kPa], speed [RPM], or the level's own unit."""
    if stepset.kind == "friction-speed":
        return "speed_rpm", levels
    if stepset.kind == "friction-force" and stepset.input_unit == "N":
        rig: Apparatus = stepset.apparatus
        return "stress_kpa", np.array([rig.stress_kpa(force) for force in levels])
    if stepset.kind == "friction-force" and stepset.input_unit in PRESSURE_KPA:
        return "stress_kpa", levels * PRESSURE_KPA[stepset.input_unit]
    return f"level_{stepset.input_unit or 'number'}".replace("%", "pct"), levels


def friction_fit(stepset: StepSet, fits: Sequence[LevelFit], share: float | None) -> FrictionFit:
    """Trends and warnings about the curves of all levels."""
    levels = np.array([fit.level for fit in fits])
    over, x = trend_axis(stepset, levels)
    warnings = _level_warnings(stepset, fits, share)
    coefficient: list[float | None] = [None] * len(fits)
    if stepset.kind == "friction-force":
        if over == "stress_kpa" and stepset.output_unit in TORQUE_UNITS:
            coefficient = [
                stepset.apparatus.friction_coefficient(fit.curve.Ts, float(at)) if at > 0 else None
                for fit, at in zip(fits, x, strict=True)
            ]
        elif over == "stress_kpa":
            warnings.append(
                f"C_f was not computed: Eq. (1) takes a torque in N·m, and the output is in {stepset.output_unit}"
            )
        else:
            warnings.append(
                "C_f was not computed and the trends run over the level itself: a level in "
                f"{stepset.input_unit or 'no unit'} is neither a force nor a stress; say so with --units input=N"
            )
    trends: dict[str, Trend] = {}
    for name, form in FORMS_OVER.get(stepset.kind, {}).items():
        values = coefficient if name == "C_f" else [getattr(fit.curve, name) for fit in fits]
        if any(value is None for value in values):
            continue
        if len(fits) < LEAST[form]:
            warnings.append(
                f"no trend of {name} over {over}: a {form} trend needs at least {LEAST[form]} levels, "
                f"and there are {len(fits)}"
            )
            continue
        trend = fit_trend(x, np.array(values, dtype=np.float64), over, form)
        trends[name] = trend
        if trend.form == "merged-exponential":
            warnings.append(
                f"the two rates of the trend of {name} merge: its limit (p + q x) e^(r x) is given, "
                "for a pair would be two huge weights that cancel"
            )
        if trend.at_bounds:
            warnings.append(
                f"the trend of {name} has a rate as steep as is looked for ({', '.join(trend.at_bounds)}): "
                "it follows one point, not a trend"
            )
        if not trend.converged:
            warnings.append(f"the trend of {name} did not converge")
    return FrictionFit(
        share, tuple(fits), trends, over, tuple(x.tolist()), tuple(coefficient), _together(fits), tuple(warnings)
    )


def _together(fits: Sequence[LevelFit]) -> Solver:
    solvers = [fit.solver for fit in fits]
    failed = [f"{fit.level:g}" for fit in fits if not fit.solver.converged]
    return Solver(
        converged=not failed,
        message=f"not converged at level {', '.join(failed)}" if failed else "converged at every level",
        evaluations=sum(s.evaluations for s in solvers),
        starts=tuple(float(c) for c in _sum_of_starts(solvers)),
        at_bounds=tuple(f"{name} at level {f.level:g}" for f in fits for name in f.solver.at_bounds),
        promise=max(s.promise for s in solvers),
    )


def _sum_of_starts(solvers: Sequence[Solver]) -> Array:
    fewest = min(len(s.starts) for s in solvers)
    return np.asarray(np.sum([s.starts[:fewest] for s in solvers], axis=0))


def _level_warnings(stepset: StepSet, fits: Sequence[LevelFit], share: float | None) -> list[str]:
    unit = f" {stepset.input_unit}" if stepset.input_unit else ""
    ends = {level.level: float(level.time_s[-1]) for level in stepset.levels}
    long = [f"{f.level:g}" for f in fits if f.curve.tau2 > ends[f.level] and f.curve.Ts > 0]
    warnings = []
    if long:
        warnings.append(
            f"τ2 is longer than the record at level {', '.join(long)}{unit}: these data cannot tell it, "
            "nor how far T_s goes on rising; record longer"
        )
    merged = [f"{f.level:g}" for f in fits if f.curve.tau2 < 1.01 * f.curve.tau1]
    if merged:
        warnings.append(f"one exponential is enough at level {', '.join(merged)}{unit}: τ1 and τ2 coincide there")
    fast = [f"{f.level:g}" for f in fits if "τ1 at 1 ms" in f.solver.at_bounds]
    if fast:
        warnings.append(f"τ1 is at its floor of 1 ms at level {', '.join(fast)}{unit}: the fast rise is not resolved")
    dead = [f"{f.level:g}" for f in fits if "T_s at 0" in f.solver.at_bounds]
    if dead:
        warnings.append(
            f"T_s is at 0 at level {', '.join(dead)}{unit}: the output does not rise with the step; "
            "check the sign of the output"
        )
    if share is None:
        lost = [f"{f.level:g}" for f in fits if f.curve.C < 0.02 or f.curve.C > 0.98 or f.level in _runaway(fits, ends)]
        if lost:
            warnings.append(
                f"a free C is not determined at level {', '.join(lost)}{unit}: the slow part and T_s run away "
                "together; hold it (--share 0.85) or record longer"
            )
    return warnings


def _runaway(fits: Sequence[LevelFit], ends: dict[float, float]) -> set[float]:
    return {f.level for f in fits if f.curve.tau2 > 3 * ends[f.level]}


def refuse_empty(stepset: StepSet) -> None:
    """A set without a rising step cannot be fitted."""
    if not stepset.levels:
        raise DataError("no rising step was found in the logs; give --step-at, or check the input column")
