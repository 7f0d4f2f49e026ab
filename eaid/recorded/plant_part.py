"""The plant of a recorded fit as results hold it: its numbers with their intervals, T_s of levels each its own."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from eaid.arrays import Array, median
from eaid.estimate.own_level import (
    LAG_OFF,
    NO_SCATTER,
    find_levelled_off,
    gains_of_runs,
    levels_about,
    levels_scatter,
    pull_to_line,
)
from eaid.estimate.scatter import LEVELS_TO_SPARE, scatter_about
from eaid.estimate.spread import LevelScatter
from eaid.findings import Finding, finding
from eaid.plant.forms import RESTING, PerLevel
from eaid.recorded.curve_intervals import LIMITS_PCT
from eaid.recorded.from_logs import Solved, fit_near, fit_through, plant_found
from eaid.recorded.inputs import FEW_LEVELS, Excited
from eaid.recorded.log_intervals import Spread, spread
from eaid.results.common import Interval
from eaid.results.models import FittedData, Friction, FrictionLevel, LevelIntervals
from eaid.results.plant import LAGS, FittedPlant, PlantIntervals, number_at
from eaid.results.recorded import KindTried
from eaid.steps.stepset import Level

LEAST_SIZE = 0.02  # Of the largest T_s, in whose parts one that is next to 0 by the curve is counted
MAY_BE_0 = 0.7  # Half-width of the logarithm beyond which a level's interval is that of its value
NOTHING = 1e-9  # Part of the largest T_s, or standard error, below which there is none
LONGEST_LAG = 3.0  # Holds up to which a level's own lag is told
LAG_KNOWN = 0.5  # Standard error of ln τ of levels by themselves up to which they tell that
WIDE_INTERVAL = 2.0  # Half-width, as a part of the number, beyond which an interval says nothing


OwnRow = tuple[str, Array, Array, Array]  # Name of a number, its lower ends, values and upper ends, (L,)


@dataclass(frozen=True, eq=False)
class LevelsOwn:
    """Levels that were held, ln T_s of each, its own about the curve, and the half-width of its interval, (L,)."""

    u: Array
    Ts: Array
    half: Array
    scatter: float  # σ_d: how far levels lie off the curve, a part of T_s
    told: list[Finding]
    through: Solved | None  # The fit with T_s of each level, of logs
    by_form: bool  # Whether they are of one rig, and lie off the curve since they follow no such one

    @property
    def wide(self) -> list[Finding]:
        """Levels at which the logs do not fix T_s."""
        at, limit = self.u[100 * np.expm1(self.half) > LIMITS_PCT["Ts"]], LIMITS_PCT["Ts"]
        return [finding("input-leaves-tau-open", "nonlinear", at, parameter="Ts", limit_pct=limit)] if len(at) else []

    @property
    def row(self) -> OwnRow:
        """T_s with the intervals, on the logarithm but for what may be 0."""
        value, may_be_0 = np.exp(self.Ts), self.half > MAY_BE_0
        low = np.where(may_be_0, np.maximum(value * (1 - self.half), 0.0), value * np.exp(-self.half))
        high = np.where(may_be_0, value * (1 + self.half), value * np.exp(np.minimum(self.half, MAY_BE_0)))
        return "Ts", low, value, high


def find_own_levels(solved: Solved, known: Spread | None, inputs: Excited, levels: Sequence[Level]) -> LevelsOwn | None:
    """T_s of levels that were held, by their runs where a fit is of their mean curves; None where logs part no level
    from the curve: single runs, inputs that move, or hardly more levels than the curve has coefficients."""
    setup, first = solved.setup, solved.setup.model.slices[0]
    u = np.array([level.level for level in levels]) if levels else inputs.levels
    held = inputs.stepwise and first.stop + LEVELS_TO_SPARE <= len(u) <= FEW_LEVELS
    if known is None or not held or setup.model.signed or solved.instruments is not None or solved.beside is not None:
        return None
    D = setup.slopes(u)[0][:, first]
    size = D @ solved.x[first]
    size = np.maximum(size, LEAST_SIZE * float(size.max()))
    if not (size > 0).all():
        return None
    through = None if levels else fit_through(solved, PerLevel(tuple(u.tolist())))
    by_themselves = _by_runs(solved, known, levels, size) if through is None else _by_logs(through, u)
    if by_themselves is None or (by_themselves[0] <= 0).any():
        return None
    Ts, covariance, degrees, gains = by_themselves
    line = levels_about(Ts, size, D, covariance)
    if line.v[0] <= NO_SCATTER**2:
        return None
    own, half, _ = pull_to_line(line, size, degrees, gains)
    curve, error = np.log(size), float(np.sqrt(median(np.diag(covariance))))
    flat = find_levelled_off(u, np.log(Ts), curve, error, "levels" if levels else "duty")
    by_curve = bool(flat) or not levels
    told = [*flat, *levels_scatter(line, u, own, curve, by_curve)]
    found = LevelsOwn(u, own, half, float(np.sqrt(line.v[0])), told, through, by_curve and bool(told))
    still = u[found.row[-1] <= RESTING * Ts.max()]
    if len(still):
        told.append(msgspec.structs.replace(finding("output-stays-at-rest", "nonlinear", still), severity="caution"))
    return found


# T_s of levels by themselves, the covariance of its logarithms, its degrees of freedom, how the gains of runs scatter
ByThemselves = tuple[Array, Array, float, LevelScatter | None]


def _by_runs(solved: Solved, known: Spread, levels: Sequence[Level], size: Array) -> ByThemselves | None:
    """Of steps from rest: the gain of each mean curve, as those of its runs scatter."""
    if known.runs is None or max(len(level.runs) for level in levels) < 2:
        return None
    setup, first = solved.setup, solved.setup.model.slices[0].stop
    curves = [y + missed for y, missed in zip(solved.outputs, solved.missed, strict=True)]
    own = [1 - float(f @ r) / (float(f @ f) or 1.0) for f, r in zip(curves, solved.missed, strict=True)]
    by_lags = np.zeros((len(levels), setup.size))  # how ln T_s of a level by itself goes with the other unknowns
    for k, f in enumerate(curves):
        J = setup.jacobian(solved.x, k)[0][:, first:] / np.sqrt(float(setup.drives[k].w.max()))
        by_lags[k, first:] = -(f @ J) / (f @ f)
    gains = gains_of_runs(levels, [f * gain for f, gain in zip(curves, own, strict=True)])
    covariance = np.diag(gains.expected[:, 0]) + by_lags @ known.covariance @ by_lags.T
    return np.array(own) * size, covariance, float(gains.degrees.sum()), gains


def _by_logs(found: Solved, u: Array) -> ByThemselves | None:
    """Of any log whose input is held: T_s of each level as an unknown, in place of the curve's coefficients."""
    if not found.solver.converged or not found.x[: len(u)].max() > 0:
        return None
    of, Ts = spread(found), np.maximum(found.x[: len(u)], NOTHING * found.x[: len(u)].max())
    degrees = min(of.variance(row)[1] for row in np.eye(len(u), len(found.x)))
    covariance = of.covariance[: len(u), : len(u)]
    size = np.sqrt(np.diag(covariance))
    held = size <= NOTHING * size.max()  # at 0 by its constraint: no surer than the others
    covariance = covariance + np.diag(np.where(held, median(size[~held]) ** 2, 0.0))
    return Ts, covariance / np.outer(Ts, Ts), degrees, None


def find_own_lags(solved: Solved, inputs: Excited, levels: Sequence[Level]) -> tuple[list[OwnRow], list[Finding]]:
    """Where the time constants of held levels lie off their curves by more than the logs, or the runs of levels, leave
    open: each level's τ1 and τ2, and T_s, is an unknown in place of the curves' coefficients."""
    setup, model, part = solved.fitted, solved.fitted.model, solved.fitted.model.slices[1]
    u = np.array([level.level for level in levels]) if levels else inputs.levels
    held = inputs.stepwise and 1 < part.stop - part.start <= len(u) - LEVELS_TO_SPARE and len(u) <= FEW_LEVELS
    several, two = max((len(level.runs) for level in levels), default=0) > 1, model.tau2 is not None
    if model.kind not in ("lag", "parallel") or model.signed or not held or (two and several):
        return [], []  # what is constant the evidence has chosen
    curve, each = solved.curves(u), PerLevel(tuple(u.tolist()))
    at_curve = {"tau1": curve.tau1, "tau2": curve.tau2} if two else {"tau1": curve.tau1}
    by_level = replace(model, Ts=each, tau1=each, tau2=each if two else None)
    begin = np.r_[curve.steady, *at_curve.values(), solved.x[model.slices[2].stop :]]
    found = fit_near(replace(setup, model=by_level), begin)
    of, told, own = spread(found), list[Finding](), list[OwnRow]()
    for k, (name, on_curve) in enumerate(at_curve.items(), 1):
        place = slice(k * len(u), (k + 1) * len(u))
        tau, rows = found.x[place], np.eye(len(found.x))[place]
        if not found.solver.converged or (tau <= 0).any():
            return [], []
        if tau.max() > LONGEST_LAG * setup.longest_hold_s:  # of a level that does not tell it
            continue
        if several:
            covariance, degrees = _lags_by_runs(found, levels)
        else:
            covariance = rows @ of.covariance @ rows.T / np.outer(tau, tau)
            degrees = min(of.variance(row)[1] for row in rows)
        if not np.sqrt(np.diag(covariance)).max() < LAG_KNOWN:
            continue
        line = levels_about(tau, on_curve, setup.slopes(u)[k][:, model.slices[k]], covariance)
        value, half, _ = pull_to_line(line, on_curve, degrees)
        if np.abs(value - np.log(on_curve)).max() >= LAG_OFF:
            more = levels_scatter(line, u, value, np.log(on_curve), by_curve=True, parameter=name)
            told += more
            own += [(name, np.exp(value - half), np.exp(value), np.exp(value + half))] if more else []
    return own, told


def _lags_by_runs(found: Solved, levels: Sequence[Level]) -> tuple[Array, float]:
    """Covariance of ln τ of levels by themselves, as those of their runs scatter, and its degrees of freedom."""
    own, count = [], len(levels)
    for k in range(count):
        J, root = found.setup.jacobian(found.x, k)[0], np.sqrt(float(found.setup.drives[k].w.max()))
        own.append(J[:, [k, count + k]] * found.x[[k, count + k]] / root)  # by ln T_s and ln τ
    seen = scatter_about(levels, own)
    return np.diag(seen.expected[:, 1]), float(seen.degrees.sum())


def plant_part(
    solved: Solved, data: FittedData, uncertainty: Spread | None, tried: tuple[KindTried, ...], inputs: Excited,
    own: LevelsOwn | None,
) -> FittedPlant:  # fmt: skip
    """The plant that every later command reads, with 95 % intervals of what is constant over the input, and of what
    goes with it at some inputs; T_s of levels is each its `own` where their runs tell it."""
    p, units = plant_found(solved), (data.input_unit, data.output_unit)
    known, model, top = FittedPlant.of(p, units), solved.setup.model, solved.setup.model.high
    if own is not None and model.kind != "parallel":
        Ts = zip(own.u.tolist(), np.exp(own.Ts).tolist(), strict=True)
        known = msgspec.structs.replace(known, Ts_levels=tuple(Ts))
    if uncertainty is None:
        return msgspec.structs.replace(known, tried=tried)
    late = solved.setup.at("dead") >= 0 and solved.setup.dead_time_of_plant(solved.x) > 0
    constant, rows = ["dead_time_s"] * late, list[tuple[str, float]]()
    if model.kind != "parallel":
        constant = [name for name in known.numbers if name != "dead_time_s" or constant]
        if inputs.stepwise or known.zeta is not None:  # two lags in series, or ringing, have no curves of their own
            rows += [("Ts", u) for u in (inputs.levels if inputs.stepwise else inputs.shown).tolist()]
        rows += [(name, u) for name in constant if known.paced and name in LAGS for u in inputs.shown.tolist()]

    def numbers(x: Array) -> Array:
        one = replace(model.parameters(x[: model.size]), dead_time_s=solved.setup.dead_time_of_plant(x))
        return np.array([*(number_at(one, name, top) for name in constant), *(number_at(one, *row) for row in rows)])

    ends, levels = iter(intervals(numbers, solved.x, uncertainty)), dict[str, list[tuple[float, float, float]]]()
    found = dict(zip(constant, ends, strict=False))
    for (name, u), one in zip(rows, ends, strict=True):
        levels.setdefault(name, []).extend([(u, *one)] if one is not None else [])
    by_level = {name: tuple(at) for name, at in levels.items()}
    if known.Ts_levels and own is not None:
        _, low, _, high = own.row
        by_level["Ts"] = tuple(zip(own.u.tolist(), low.tolist(), high.tolist(), strict=True))
    return msgspec.structs.replace(known, ci95=PlantIntervals(levels=by_level, **found), tried=tried)


def levels_of_plant(part: FittedPlant, levels: Sequence[float]) -> Friction | None:
    """T_s, τ1 and τ2 of some levels as a plant of one lag, or two in parallel, has them; None of other kinds."""
    p, rows = part.plant, []
    if p.zeta is not None:
        return None
    for u in levels:
        at, known = replace(p.at(u), Ts=part.value("Ts", u)), {name: one for name, (_, one) in part.at(u).items()}
        ends = None if part.ci95 is None else LevelIntervals(*(known.get(name) for name in ("Ts", "tau1", "tau2", "C")))
        rows.append(FrictionLevel(u, at.Ts, at.tau1, at.tau2, at.C, ci95=ends))
    return Friction(p.C, levels=tuple(rows))


def intervals(
    numbers: Callable[[Array], Array], x: Array, uncertainty: Spread, signed: Sequence[int] = ()
) -> list[Interval]:
    """The 95 % intervals of numbers of the unknowns, (m,), on their logarithms where they are above 0, but for those
    that are `signed`. None: it says nothing."""
    found, gradients = list[Interval](), np.zeros((len(numbers(x)), len(x)))
    for k, step in enumerate(np.diag(1e-6 * np.maximum(np.abs(x), 1e-9))):
        gradients[:, k] = (numbers(x + step) - numbers(x - step)) / (2 * step[k])
    for k, (value, half) in enumerate(zip(numbers(x).tolist(), map(uncertainty.of, gradients), strict=True)):
        sizes = k not in signed
        if sizes and value > 0 and half < WIDE_INTERVAL * value:
            found.append((value * float(np.exp(-half / value)), value * float(np.exp(half / value))))
        else:
            found.append((value - half, value + half) if (value <= 0 or not sizes) and half < np.inf else None)
    return found
