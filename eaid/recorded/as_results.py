"""Solved unknowns → the parts of fit.json."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import msgspec
import numpy as np

from eaid.arrays import Array
from eaid.estimate.coefficients import coefficient_intervals, coefficients_of, covariance_part, turned
from eaid.estimate.data import data_of, errors
from eaid.estimate.from_logs import Solved, model_of
from eaid.estimate.linear import bounds_of, fit_each_level, single_levels
from eaid.estimate.log_intervals import CurveSpread, Spread
from eaid.estimate.noise import FEWEST_ENGAGEMENTS
from eaid.estimate.nonlinear import scored
from eaid.estimate.record import RecordedLog
from eaid.logs.run import Run
from eaid.models import nonlinear as curve
from eaid.models.parameters import Linear as Eq8
from eaid.results.common import Input, Interval, LevelError, Source
from eaid.results.fit import (
    CoefficientIntervals,
    Covariance,
    CurveLevel,
    FittedData,
    Friction,
    FrictionLevel,
    LevelIntervals,
    Linear,
    Noise,
    Nonlinear,
    Release,
    Rig,
    Uncertainty,
)
from eaid.results.recorded import Falls
from eaid.steps.levels import wanted_levels
from eaid.steps.stepset import Level, StepSet

OWN_RECORDS = 3.0
"""Levels' own linear models are of steps of the fitted model, so many of its longest τ2 long …"""
LONGEST_OWN_S = 60.0
"""… and no longer than this."""
OWN_SAMPLES = 2000
WIDEST = 10.0
"""An interval wider than this factor says nothing."""


def data_part(
    logs: Sequence[RecordedLog], runs: Sequence[RecordedLog | Run], steps: StepSet | None, levels: Array
) -> FittedData:
    """What was fitted."""
    first = next((run for run in runs if isinstance(run, Run)), None)
    rates = [(len(log.time_s) - 1) / float(log.time_s[-1] - log.time_s[0]) for log in logs]
    sources = [
        Source(
            path=log.source,
            sha256=log.sha256,
            run=log.name,
            baseline_nm=log.baseline,
            samples=len(log.time_s),
            edge="recorded",
        )
        for log in logs
        if log.source
    ]
    inputs = {log.source: log.sha256 for log in logs if log.source and Path(log.source).is_file()}
    made = first.synthetic if first is not None else None
    return FittedData(
        kind=(first.kind if first is not None and first.kind else steps.kind if steps is not None else "clutch"),  # type: ignore[arg-type]
        input_unit="%" if first is None else first.input_unit,
        output_unit="N·m" if first is None else first.output_unit,
        levels=tuple(levels.tolist()),
        sample_rate_hz=max(rates),
        apparatus=Rig() if steps is None else Rig(**asdict(steps.apparatus)),
        sources=tuple(sources),
        inputs=tuple(Input(path, digest) for path, digest in inputs.items()),
        synthetic=made if made is not None else None if steps is None else steps.synthetic,
    )


def nonlinear_part(solved: Solved, uncertainty: Spread | None, known: CurveSpread | None, shown: Array) -> Nonlinear:
    """The ten coefficients, with errors by level and intervals."""
    total, free = errors(solved.outputs, solved.missed), solved.setup.model.free_share
    intervals, covariance = (None, None) if uncertainty is None else _coefficients(solved, uncertainty)
    part = msgspec.structs.replace(
        scored(model_of(solved), free, total, _level_errors(solved, shown), solved.solver),
        curves=() if known is None else _curves(known),
        ci95=intervals,
        covariance=covariance,
    )
    return Nonlinear.of(part, identifiable=None if known is None else bool((known.half_width < WIDEST).all()))


def _level_errors(solved: Solved, shown: Array) -> tuple[LevelError, ...]:
    """Errors of the rows whose input is nearest to each of some levels; rests are left out."""
    duty = np.concatenate([drive.duty[drive.index][drive.w > 0] for drive in solved.setup.drives])
    y, missed = np.concatenate(solved.outputs), np.concatenate(solved.missed)
    nearest = np.where(duty > 0, np.searchsorted(0.5 * (shown[1:] + shown[:-1]), duty), -1)
    rows = []
    for i, level in enumerate(shown.tolist()):
        at = nearest == i
        rows.append(errors([y[at]], [missed[at]]).at(level) if at.any() else LevelError(level))
    return tuple(rows)


def _curves(known: CurveSpread) -> tuple[CurveLevel, ...]:
    rows = []
    for i, level in enumerate(known.duty.tolist()):
        ends: list[Interval] = [
            (float(known.low[k, i]), float(known.high[k, i])) if known.half_width[k, i] < WIDEST else None
            for k in range(3)
        ]
        Ts, tau1, tau2 = known.values[:, i].tolist()
        rows.append(CurveLevel(level, Ts, tau1, tau2, LevelIntervals(*ends)))
    return tuple(rows)


def _coefficients(solved: Solved, uncertainty: Spread) -> tuple[CoefficientIntervals, Covariance]:
    """Intervals of the paper's coefficients, and their covariance in powers of u/100."""
    model = solved.setup.model
    plain, T = coefficients_of(model_of(solved), model.free_share), turned(model)
    V = uncertainty.covariance[: T.shape[1], : T.shape[1]]
    covariance, degrees = T @ V @ T.T, degrees_of(solved, uncertainty)
    return coefficient_intervals(plain, covariance, {**degrees}), covariance_part(
        plain, covariance, {**degrees}, "robust"
    )


def degrees_of(solved: Solved, uncertainty: Spread) -> dict[str, float]:
    """Degrees of freedom of T_s, τ1, τ2 at the middle of the range."""
    model = solved.setup.model
    slopes = solved.setup.slopes(np.array([0.5 * (model.low + model.high)]))
    return {name: uncertainty.variance(slopes[k, 0])[1] for name, k in (("tau1", 1), ("tau2", 2), ("Ts", 0))}


def uncertainty_part(solved: Solved, uncertainty: Spread) -> Uncertainty:
    """Where the intervals come from, and the noise that further recordings can be planned with."""
    seen = uncertainty.scatter
    return Uncertainty(
        ci="robust",
        scatter_from="engagements" if seen.count >= FEWEST_ENGAGEMENTS else "within",
        degrees_of_freedom=min(degrees_of(solved, uncertainty).values()),
        noise=Noise(seen.sensor_nm2_s, seen.ripple_s, {"Ts": seen.gain, "tau1": 0.0, "tau2": 0.0}),
    )


def linear_part(solved: Solved, base: Solved, levels: Array, wanted: str | None) -> Linear:
    """Eq. (8) of the logs, and of each level by itself: of steps of the fitted nonlinear model."""
    tables = solved.curves(levels)
    a0 = 1 / float(tables.tau1[0])
    if len(levels) > 1:
        slope = float((tables.steady[-1] - tables.steady[0]) / (levels[-1] - levels[0]))
        offset = float(tables.steady[0]) - slope * float(levels[0])
    else:
        slope, offset = float(tables.steady[0] / levels[0]), 0.0
    pooled = Eq8(a0, a0 * slope, a0 * offset)
    total = errors(solved.outputs, solved.missed)
    of_model = data_of(_own_steps(base, levels))
    rows = single_levels(of_model, fit_each_level(of_model))
    return Linear(
        a0=pooled.a0,
        b0=pooled.b0,
        c0=pooled.c0,
        rmse=total.rmse,
        sse=total.sse,
        fit_pct=total.fit_pct,
        R2=total.R2,
        solver=solved.solver,
        per_level=rows,
        bounds=bounds_of(rows, None if wanted is None else wanted_levels(wanted, levels.tolist(), "bounds_levels")),
    )  # fmt: skip


def _own_steps(base: Solved, levels: Array) -> list[Level]:
    """Steps from rest of the fitted model to each level."""
    p = model_of(base)
    slowest = float(np.max(curve.time_constants(p, levels)[1]))
    t = np.linspace(0.0, min(OWN_RECORDS * slowest, LONGEST_OWN_S), OWN_SAMPLES)
    return [Level(float(u), t, curve.step_response(p, t, float(u))[None], (f"{u:g}",)) for u in levels]


def friction_part(solved: Solved, levels: Array, known: CurveSpread | None) -> Friction:
    """T_s, τ1, τ2 of the levels: those of the nonlinear model with their intervals, or each level's by itself."""
    share, tables = solved.setup.model.share, solved.curves(levels)
    assert share is not None
    ends = {row.level: row.ci95 for row in (() if known is None else _curves(known))}
    values = zip(tables.steady.tolist(), tables.tau1.tolist(), tables.tau2.tolist(), strict=True)
    rows = [
        FrictionLevel(
            one.level, Ts, tau1, tau2, share, rmse=one.rmse, sse=one.sse, fit_pct=one.fit_pct, R2=one.R2,
            ci95=ends.get(one.level),
        )
        for one, (Ts, tau1, tau2) in zip(_level_errors(solved, levels), values, strict=True)
    ]  # fmt: skip
    return Friction(C=share, levels=tuple(rows), solver=solved.solver)


def release_part(solved: Solved, falls: Falls) -> Release | None:
    """Time constants of falls to rest, where they were fitted."""
    if not falls.release_fitted or falls.release_tau1 is None or falls.release_tau2 is None:
        return None
    share = solved.setup.model.share
    return Release(tau1=falls.release_tau1, tau2=falls.release_tau2, C=0.85 if share is None else share)
