"""The friction model: the curve of every level, the coefficient of friction by Eq. (1), and trends, specification 3."""

from collections.abc import Callable, Sequence

import msgspec
import numpy as np

from eaid.apparatus import Apparatus
from eaid.arrays import Array
from eaid.findings import Finding, finding
from eaid.fitting import metrics, robust, samples
from eaid.fitting.data import Data
from eaid.fitting.levels import fit_levels
from eaid.fitting.trends import LEAST, Form, fit_trend
from eaid.fitting.verdict import judged
from eaid.models import friction as model
from eaid.models.parameters import SHARE, TAU_FLOOR_S
from eaid.models.parameters import Friction as FrictionCurve
from eaid.options import FitOptions
from eaid.results.common import HoldOut, Huber, Solver
from eaid.results.friction import Friction, FrictionLevel, Trend
from eaid.steps.stepset import Level, StepSet

PRESSURE_KPA: dict[str, float] = {"Pa": 1e-3, "kPa": 1.0, "MPa": 1e3, "bar": 100.0, "mbar": 0.1}
"""Units of an input that is a stress already."""
TORQUE_UNITS = ("N·m", "Nm", "N.m", "N*m")
FORMS_OVER: dict[str, dict[str, Form]] = {
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


def friction_fit(
    stepset: StepSet, fits: Sequence[FrictionLevel], share: float | None
) -> tuple[Friction, list[Finding]]:
    """The curves of all levels with the coefficient of friction and trends, and what is to be doubted of them."""
    over, x = trend_axis(stepset, np.array([fit.level for fit in fits]))
    found = level_findings(stepset, fits)
    coefficient: list[float | None] = [None] * len(fits)
    if stepset.kind == "friction-force":
        if over != "stress_kpa":
            found.append(finding("level-is-no-stress", "friction", unit=stepset.input_unit or "no unit"))
        elif stepset.output_unit not in TORQUE_UNITS:
            found.append(finding("output-is-no-torque", "friction", unit=stepset.output_unit))
        else:
            coefficient = [
                stepset.apparatus.friction_coefficient(fit.Ts, float(at)) if at > 0 else None
                for fit, at in zip(fits, x, strict=True)
            ]
    trends: dict[str, Trend] = {}
    for name, form in FORMS_OVER.get(stepset.kind, {}).items():
        values = coefficient if name == "C_f" else [getattr(fit, name) for fit in fits]
        if any(value is None for value in values):
            continue
        if len(fits) < LEAST[form]:
            found.append(
                finding(
                    "trend-needs-levels",
                    "friction",
                    parameter=name,
                    over=over,
                    form=form,
                    least=LEAST[form],
                    count=len(fits),
                )
            )
            continue
        trends[name] = fit_trend(x, np.array(values, dtype=np.float64), over, form)
        found += _trend_findings(name, trends[name])
    key = {"stress_kpa": "stress_kpa", "speed_rpm": "speed_rpm"}.get(over)
    levels = tuple(
        msgspec.structs.replace(fit, C_f=c, **({key: float(at)} if key else {}))
        for fit, at, c in zip(fits, x, coefficient, strict=True)
    )
    return Friction(share, over, levels, trends, _together(fits)), found


def _trend_findings(name: str, trend: Trend) -> list[Finding]:
    found = []
    if trend.form == "merged-exponential":
        found.append(finding("trend-rates-merge", "friction", parameter=name))
    if steep := [code for code in trend.at_bounds if code != "rates-meet"]:
        found.append(finding("trend-follows-one-point", "friction", parameter=name, rates=tuple(steep)))
    if not trend.converged:
        found.append(finding("trend-not-converged", "friction", parameter=name))
    return found


def _together(fits: Sequence[FrictionLevel]) -> Solver:
    """One verdict for all levels: the worst of theirs."""
    solvers = [fit.solver for fit in fits if fit.solver is not None]
    failed = [f"{fit.level:g}" for fit in fits if fit.solver is not None and not fit.solver.converged]
    fewest = min(len(one.starts) for one in solvers)
    costs = np.sum([one.costs[:fewest] for one in solvers], axis=0)
    worst = max(one.predicted_decrease or 0.0 for one in solvers)
    held = [code for one in solvers for code in one.at_bounds]
    solver = judged(worst, sum(one.evaluations for one in solvers), costs, held)
    said = f"not converged at level {', '.join(failed)}" if failed else "converged at every level"
    return msgspec.structs.replace(solver, converged=not failed, message=said)


def level_findings(stepset: StepSet, fits: Sequence[FrictionLevel]) -> list[Finding]:
    """What the levels' own curves cannot tell."""

    def where(holds: Callable[[FrictionLevel], bool]) -> list[float]:
        return [fit.level for fit in fits if holds(fit)]

    def at_bound(code: str) -> list[float]:
        return where(lambda fit: fit.solver is not None and code in fit.solver.at_bounds)

    rows = {
        "level-not-converged": where(lambda fit: fit.solver is not None and not fit.solver.converged),
        "fast-rise-not-resolved": at_bound("tau1-floor"),
        "output-does-not-rise": at_bound("Ts-zero"),
    }
    return [finding(code, "friction", levels, unit=stepset.input_unit) for code, levels in rows.items() if levels]


def fit_curves(data: Data, options: FitOptions) -> tuple[list[FrictionLevel], Huber | None]:
    """The friction curve of each level, under the loss that was asked for; errors are of the data themselves."""
    fits, huber = robust.minimise(
        data,
        options.loss,
        lambda d: fit_levels(d, options.held_share),
        lambda d, _: fit_levels(d, options.held_share),
        curve_residuals,
    )
    rows = []
    for one, record, r in zip(fits, data.records, curve_residuals(fits, data), strict=True):
        sse = one.sse if huber is None and one.sse is not None else float(r @ r)
        fit_pct, R2 = metrics.quality(sse, [record.y])
        rmse = float(np.sqrt(sse / len(r)))
        rows.append(msgspec.structs.replace(one, sse=sse, rmse=rmse, fit_pct=fit_pct, R2=R2))
    return rows, huber


def curve_residuals(fits: Sequence[FrictionLevel], on: Data) -> list[Array]:
    """f − y of each level's own curve at every sample."""
    return samples.residuals(np.array([[f.Ts, f.tau1, f.tau2, f.C] for f in fits]).T, on.records)


def missed_levels(fits: Sequence[FrictionLevel], data: Data) -> list[float]:
    """Levels whose own curve explains little of their output."""
    pairs = zip(fits, data.records, curve_residuals(fits, data), strict=True)
    return [one.level for one, record, r in pairs if metrics.explains_little([record.y], [r])]


def friction_hold_out(part: Friction, stepset: StepSet, held_out: Sequence[Level]) -> HoldOut | None:
    """Held-out levels against the curve whose T_s, τ1, τ2 the trends give; None where a trend is missing."""
    if not all(name in part.trends for name in ("Ts", "tau1", "tau2")):
        return None

    def predicted(level: Level) -> Array:
        x = trend_axis(stepset, np.array([level.level]))[1]
        trends = (part.trends[name] for name in ("Ts", "tau1", "tau2"))
        Ts, tau1, tau2 = (float(trend.predict(x)[0]) for trend in trends)
        share = SHARE if part.C is None else part.C
        curve = FrictionCurve(Ts, max(tau1, TAU_FLOOR_S), max(tau2, TAU_FLOOR_S), share)
        return model.step_response(curve, level.time_s)

    samples, sse = sum(f.samples or 0 for f in part.levels), sum(f.sse or 0.0 for f in part.levels)
    return metrics.hold_out(held_out, predicted, float(np.sqrt(sse / samples)))
