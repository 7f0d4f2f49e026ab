"""Solved unknowns → the parts of fit.json."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from eaid.arrays import Array
from eaid.fitting.data import data_of
from eaid.fitting.first_order import fit_own_levels
from eaid.fitting.linear import bounds_of, by_convention
from eaid.fitting.options import CONVENTIONS
from eaid.logs.run import Run
from eaid.models import nonlinear as curve
from eaid.models.parameters import Linear as Eq8
from eaid.recorded.curve_intervals import CurveSpread
from eaid.recorded.intervals import Spread
from eaid.recorded.log import RecordedLog
from eaid.recorded.noise_results import degrees_of
from eaid.recorded.solve import Solved, model_of
from eaid.results.common import AbsError, Input, Interval, LevelError, Source
from eaid.results.fit import Data
from eaid.results.friction import Friction, FrictionLevel, LevelIntervals
from eaid.results.linear import Linear
from eaid.results.nonlinear import CoefficientIntervals, Covariance, CurveLevel, Nonlinear
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
) -> Data:
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
    return Data(
        kind=(first.kind if first is not None and first.kind else steps.kind if steps is not None else "clutch"),  # type: ignore[arg-type]
        input_unit="%" if first is None else first.input_unit,
        output_unit="N·m" if first is None else first.output_unit,
        levels=tuple(levels.tolist()),
        sample_rate_hz=max(rates),
        sources=tuple(sources),
        inputs=tuple(Input(path, digest) for path, digest in inputs.items()),
        synthetic=made if made is not None else None if steps is None else steps.synthetic,
    )


def nonlinear_part(solved: Solved, sure: Spread | None, known: CurveSpread | None, shown: Array) -> Nonlinear:
    """The ten coefficients, with errors by level and intervals."""
    p = model_of(solved)
    setup = solved.setup
    pairs = zip(setup.residuals(solved.x), setup.drives, strict=True)
    left = np.concatenate([r / np.sqrt(drive.w[drive.w > 0]) for r, drive in pairs])
    intervals, covariance = (None, None) if sure is None else _coefficients(solved, sure)
    spread_y = _spread(solved)
    sse = float(left @ left)
    return Nonlinear(
        tau1=tuple(p.tau1),  # type: ignore[arg-type]
        tau2=tuple(p.tau2),  # type: ignore[arg-type]
        Ts=tuple(p.Ts),  # type: ignore[arg-type]
        u_range=p.u_range,
        C=p.C,
        C_free=setup.model.share is None,
        rmse=float(np.sqrt(sse / len(left))),
        sse=sse,
        abs_error=AbsError(float(np.abs(left).mean()), float(np.abs(left).std())),
        fit_pct=100 * (1 - float(np.sqrt(sse / spread_y))),
        R2=1 - sse / spread_y,
        per_level=_level_errors(solved, shown),
        solver=solved.solver,
        curves=_curves(known),
        ci95=intervals,
        covariance=covariance,
        identifiable=None
        if known is None
        else bool(np.isfinite(known.half_width).all() and (known.half_width < WIDEST).all()),
    )


def _spread(solved: Solved) -> float:
    """Σ (y − mean y)² over all samples of each log about its own mean."""
    total = 0.0
    for drive in solved.setup.drives:
        y = drive.y[drive.w > 0]
        total += float(((y - y.mean()) ** 2).sum())
    return max(total, 1e-300)


def _level_errors(solved: Solved, shown: Array) -> tuple[LevelError, ...]:
    """Errors of the rows whose input is nearest to each of some levels; rests are left out."""
    edges = 0.5 * (shown[1:] + shown[:-1])
    parts: list[list[Array]] = [[] for _ in shown]
    for r, drive in zip(solved.setup.residuals(solved.x), solved.setup.drives, strict=True):
        counted = drive.w > 0
        duty = drive.duty[drive.index][counted]
        left, y = r / np.sqrt(drive.w[counted]), drive.y[counted]
        which = np.where(duty > 0, np.searchsorted(edges, duty), -1)
        for i in range(len(shown)):
            at = which == i
            if at.any():
                parts[i].append(np.stack([left[at], y[at]]))
    rows = []
    for level, part in zip(shown.tolist(), parts, strict=True):
        if not part:
            rows.append(LevelError(level))
            continue
        left, y = np.concatenate(part, axis=1)
        sse, about = float(left @ left), float(((y - y.mean()) ** 2).sum())
        fit = 100 * (1 - float(np.sqrt(sse / about))) if about > 0 else None
        rows.append(
            LevelError(
                level,
                float(np.sqrt(sse / len(left))),
                sse,
                AbsError(float(np.abs(left).mean()), float(np.abs(left).std())),
                fit,
                1 - sse / about if about > 0 else None,
            )
        )
    return tuple(rows)


def _curves(known: CurveSpread | None) -> tuple[CurveLevel, ...]:
    if known is None:
        return ()
    rows = []
    for i, level in enumerate(known.duty.tolist()):
        ends: list[Interval] = [
            (float(known.low[k, i]), float(known.high[k, i])) if known.half_width[k, i] < WIDEST else None
            for k in range(3)
        ]
        values = known.values[:, i].tolist()
        rows.append(CurveLevel(level, values[0], values[1], values[2], LevelIntervals(*ends)))
    return tuple(rows)


def _coefficients(solved: Solved, sure: Spread) -> tuple[CoefficientIntervals, Covariance]:
    """Intervals of the paper's coefficients, and their covariance in powers of u/100."""
    model = solved.setup.model
    assert model.basis is not None
    count = model.size
    base = np.zeros(count)
    columns = []
    for j in range(count):
        unit = base.copy()
        unit[j] = 1.0
        p = model.basis.parameters(unit)
        columns.append([*p.tau1, *p.tau2, *p.Ts] + ([p.C] if model.share is None else []))
    T = np.zeros((len(columns[0]), solved.setup.size))
    T[:, :count] = np.array(columns).T
    if model.share is None:
        T[-1] = 0.0
        T[-1, count - 1] = 1.0
    p = model.basis.parameters(solved.coefficients)
    values = np.array([*p.tau1, *p.tau2, *p.Ts])
    half = np.array([sure.of(row) for row in T])
    ends: list[Interval] = [(float(v - h), float(v + h)) for v, h in zip(values, half, strict=False)]
    share: Interval = None
    if model.share is None:
        share = (float(p.C - half[-1]), float(p.C + half[-1]))
    scale = np.concatenate([100.0 ** np.arange(3), 100.0 ** np.arange(3), 100.0 ** np.arange(4), np.ones(len(T) - 10)])
    scaled = T * scale[:, None]
    V = scaled @ sure.covariance @ scaled.T
    order = [f"{name}[{i}]" for name, n in (("tau1", 3), ("tau2", 3), ("Ts", 4)) for i in range(n)]
    return CoefficientIntervals(tuple(ends[:3]), tuple(ends[3:6]), tuple(ends[6:10]), share), Covariance(
        parametrisation="coefficients of (u/100 %)^k, lowest power first: tau1 [s], tau2 [s], Ts [N·m]",
        order=tuple(order + ["C"] * (model.share is None)),
        matrix=tuple(tuple(row) for row in V.tolist()),
        degrees_of_freedom={**degrees_of(solved, sure)},
        from_="robust",
    )


def linear_part(solved: Solved, base: Solved, levels: Array) -> Linear:
    """Eq. (8) of the logs, and of each level by itself: of steps of the fitted nonlinear model."""
    setup = solved.setup
    tables = setup.model.tables(setup.model.rows_of(levels), solved.coefficients)
    a0 = 1 / float(tables.tau1[0])
    if len(levels) > 1:
        slope = float((tables.steady[-1] - tables.steady[0]) / (levels[-1] - levels[0]))
        offset = float(tables.steady[0]) - slope * float(levels[0])
    else:
        slope, offset = float(tables.steady[0] / levels[0]), 0.0
    pooled = Eq8(a0, a0 * slope, a0 * offset)
    sse, about = solved.cost, _spread(solved)
    own = _own_steps(base, levels)
    data = data_of(own)
    rows = {name: by_convention(data, fit_own_levels(data), pooled, name) for name in CONVENTIONS}
    conventions = {name: bounds_of(row, name, None) for name, row in rows.items()}
    return Linear(
        a0=pooled.a0,
        b0=pooled.b0,
        c0=pooled.c0,
        rmse=float(np.sqrt(sse / setup.samples)),
        sse=sse,
        fit_pct=100 * (1 - float(np.sqrt(sse / about))),
        R2=1 - sse / about,
        solver=solved.solver,
        per_level=rows["zero-offset"],
        bounds=conventions["zero-offset"],
        conventions=conventions,
    )  # fmt: skip


def _own_steps(base: Solved, levels: Array) -> list[Level]:
    """Steps from rest of the fitted model to each level."""
    p = model_of(base)
    slowest = float(np.max(curve.time_constants(p, levels)[1]))
    t = np.linspace(0.0, min(OWN_RECORDS * slowest, LONGEST_OWN_S), OWN_SAMPLES)
    return [Level(float(u), t, curve.step_response(p, t, float(u))[None], (f"{u:g}",)) for u in levels]


def friction_part(solved: Solved) -> Friction:
    """T_s, τ1, τ2 of each level by itself."""
    model = solved.setup.model
    assert model.levels is not None
    tables = model.tables(model.rows_of(model.levels), solved.coefficients)
    errors = _level_errors(solved, model.levels)
    values = zip(model.levels.tolist(), tables.steady.tolist(), tables.tau1.tolist(), tables.tau2.tolist(), strict=True)
    return Friction(
        C=model.share,
        levels=tuple(
            FrictionLevel(
                level=level, Ts=Ts, tau1=tau1, tau2=tau2, C=model.share or 0.85,
                rmse=error.rmse, sse=error.sse, fit_pct=error.fit_pct, R2=error.R2,
                solver=solved.solver,
            )
            for (level, Ts, tau1, tau2), error in zip(values, errors, strict=True)
        ),
        solver=solved.solver,
    )  # fmt: skip
