"""T_s, τ1 and τ2 of every level with intervals, the coefficient of friction by Eq. (1), and what the levels leave open.

The rows are those of the nonlinear model's curves at the levels, or of each level by itself: one value a level.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from eaid.arrays import Array, Mask
from eaid.estimate import data as metrics
from eaid.estimate.points import level_residuals
from eaid.estimate.scatter import CURVES, MEETING, Scatter
from eaid.estimate.spread import Influence, t_quantile, textbook
from eaid.estimate.trends import fit_trends
from eaid.findings import Finding, finding
from eaid.levels.certainty import SAYS_NOTHING
from eaid.levels.each_level import OwnLevels
from eaid.levels.task import FitTask
from eaid.plant.dynamics import SHARE, TAU_FLOOR_S, Step
from eaid.plant.steps import step_response
from eaid.results.common import HoldOut, Interval
from eaid.results.models import Friction, FrictionLevel, LevelIntervals
from eaid.steps.stepset import Level, StepSet

OPEN_HALF_WIDTH = float(np.log(3.0))  # Half-width of the logarithm from which a parameter counts as open at a level
# Part of a record, and half-width of its logarithm, within which τ2 has to be known at most levels
KNOWN_TO, WIDEST_TAU2 = 0.25, 0.5
# By so much T_s and τ1 are less sure where the records do not tell τ2: simulated sets of 5 s for a τ2 of 5 to 17 s
WIDER = 1.4
# Record lengths that the interval of τ2 may reach to: where most levels' reach further, none is quoted, for what is
# quoted would be what came out short by chance
QUOTED_RECORDS = 2.0
HALF_WIDTH_ROWS = 200  # Rows of a level's curve, denser at its begin, among which the least sure is looked for
# Parameters that a constraint holds: not estimable
HELD_BY = {"tau1-floor": ("tau1",), "tau2-meets-tau1": ("tau1", "tau2"), "Ts-zero": ("Ts",), "tau2-endless": ("tau2",)}
TIME_CONSTANTS = {"tau1", "tau2"}
# Units of an input that is a stress already
PRESSURE_KPA: dict[str, float] = {"Pa": 1e-3, "kPa": 1.0, "MPa": 1e3, "bar": 100.0, "mbar": 0.1}
TORQUE_UNITS = ("N·m", "Nm", "N.m", "N*m")


@dataclass(frozen=True, eq=False)
class LevelValues:
    """T_s, τ1, τ2 of L levels, and what is known of each."""

    levels: Sequence[Level]
    theta: Array  # T_s, τ1, τ2, C, (4, L)
    held: Sequence[tuple[str, ...]]  # Parameters that a constraint holds at each level
    low: Array  # Least ln T_s, ln τ1, ln τ2, (3, L)
    high: Array
    degrees: Array  # Degrees of freedom, (3, L)

    @property
    def open(self) -> Mask:
        """Where the data do not determine a parameter, (3, L)."""
        constrained = np.array([[name in held for held in self.held] for name in CURVES])
        return np.asarray(~(0.5 * (self.high - self.low) <= OPEN_HALF_WIDTH) | constrained)

    def ci95(self, i: int) -> LevelIntervals:
        """95 % intervals of one level, of what the data tell."""
        ends: dict[str, Interval] = {}
        for k, name in enumerate(CURVES):
            low, high = float(self.low[k, i]), float(self.high[k, i])
            fine = name not in self.held[i] and self.theta[k, i] > 0 and high - low < 2 * SAYS_NOTHING
            ends[name] = (float(np.exp(low)), float(np.exp(high))) if fine else None
        degrees = zip(CURVES, self.degrees[:, i].tolist(), strict=True)
        return LevelIntervals(**ends, dof={name: one for name, one in degrees if np.isfinite(one)})


def quote_levels(
    levels: Sequence[Level], theta: Array, held: Sequence[tuple[str, ...]], ends: tuple[Array, Array, Array]
) -> LevelValues:
    """Values of levels with their ends; none of τ2 upwards where most levels' lie too far beyond the record.

    T_s and τ1 then rest on a τ2 that the records do not tell, and their intervals are wider by `WIDER`.
    """
    low, high, degrees = (part.copy() for part in ends)
    if tau2_open(levels, theta[2], low[2], high[2]):
        low[:2], high[:2] = widen(low[:2], high[:2])
        high[2] = np.inf
    return LevelValues(levels, theta, held, low, high, degrees)


def tau2_open(levels: Sequence[Level], tau2: Array, low: Array, high: Array) -> bool:
    """Whether τ2 of most levels, between its ends on the logarithm, lies too far beyond the record to be quoted."""
    record = np.array([level.time_s[-1] for level in levels])
    vague = 0.5 * (high - low) > np.minimum(KNOWN_TO * record / tau2, WIDEST_TAU2)
    beyond = vague | (high > np.log(QUOTED_RECORDS * record))
    return bool(2 * beyond.sum() > len(levels))


def quote_each(own: OwnLevels, ends: tuple[Array, Array, Array] | None = None) -> LevelValues:
    """Values of levels each by itself, with other ends than those that their runs tell where these are given."""
    ends = reach_over_slow_parts(own) if ends is None else ends
    return quote_levels(own.levels, own.scatter.theta, own.scatter.held, ends)


def reach_over_slow_parts(own: OwnLevels) -> tuple[Array, Array, Array]:
    """The ends of levels, those of T_s over every slow part that a record which does not tell τ2 leaves possible beside
    a C that is held: from the plateau to the plateau over C."""
    if own.scatter.share_free:
        return own.intervals
    low, high, degrees = (part.copy() for part in own.intervals)
    for i, (level, one) in enumerate(zip(own.levels, own.each, strict=True)):
        met = "tau2" in own.scatter.held[i]
        if met or tau2_open([level], own.scatter.theta[2, i], low[2, i], high[2, i]):
            least, most = np.log(np.maximum([one.slow.Ts_low[0], one.slow.Ts_high[0]], 1e-300)).tolist()
            half = 0.5 * float(high[0, i] - low[0, i])
            low[0, i], high[0, i] = min(low[0, i], least - half), max(high[0, i], most + half)
    return low, high, degrees


def widen(low: Array, high: Array, factor: float = WIDER) -> tuple[Array, Array]:
    """Ends so many times as far apart; `WIDER` of a T_s or τ1 that rests on a τ2 which the records do not tell."""
    middle, half = 0.5 * (low + high), 0.5 * factor * (high - low)
    return middle - half, middle + half


def white_ends(own: OwnLevels) -> tuple[Array, Array, Array]:
    """The textbook's ends of each level by itself: θ ± t s on its logarithm, from s² A⁻¹."""
    ends = []
    for level, J in zip(own.levels, own.scatter.jacobians, strict=True):
        noise, spare = textbook([level.mean - J[:, 0]], J.shape[1])
        reach = t_quantile(spare) * np.sqrt(np.maximum(np.diag(np.linalg.pinv(J.T @ J)) * noise, 0.0))[:3]
        ends.append((np.log1p(-np.minimum(reach, 1 - 1e-12)), np.log1p(reach), np.full(3, spare)))
    low, high, degrees = (np.array(part).T for part in zip(*ends, strict=True))
    return own.logs + low, own.logs + high, degrees


def friction_part(task: FitTask, values: LevelValues, own: OwnLevels | None = None) -> tuple[Friction, list[Finding]]:
    """The friction model: rows of all levels, trends, and their warnings; `own` where each was fitted by itself."""
    stepset, data, options = task.stepset, task.data, task.options
    over, x = trend_axis(stepset, data.u)
    findings, coefficient = _of_friction(stepset, over, x, values.theta[0])
    left = level_residuals(values.theta, data.records)
    shown = options.ci != "none"
    rows = []
    for i, (level, record, r) in enumerate(zip(values.levels, data.records, left, strict=True)):
        Ts, tau1, tau2, C = values.theta[:, i].tolist()
        ends, c = values.ci95(i) if shown else None, coefficient[i]
        if ends is not None and own is not None:
            ends = msgspec.structs.replace(ends, C=own.share_interval(i))
        if ends is not None and ends.Ts is not None and c is not None:
            ends = msgspec.structs.replace(ends, C_f=(c * ends.Ts[0] / Ts, c * ends.Ts[1] / Ts))
        rows.append(
            FrictionLevel(
                level.level, Ts, tau1, tau2, C,
                stress_kpa=float(x[i]) if over == "stress_kpa" else None,
                speed_rpm=float(x[i]) if over == "speed_rpm" else None,
                samples=len(r), C_f=c, **metrics.errors([record.y], [r]).scores,
                solver=None if own is None else own.each[i].solved.solver, ci95=ends,
            )
        )  # fmt: skip
    by_name = {name: [getattr(row, name) for row in rows] for name in (*CURVES, "C_f")}
    share = values.theta[3, 0].item() if options.held_share is not None else None
    if own is None:
        return Friction(share, over, tuple(rows)), findings
    seen, relative = own.scatter, None
    if seen.source == "repeats" and options.ci != "white":
        relative = np.sqrt(np.einsum("lkk->kl", seen.of_levels.covariance(actual=True))[:3])
    trends, more = fit_trends(stepset.kind, over, x, by_name, (relative, seen.degrees) if shown else None)
    findings += more
    findings += level_findings(values, seen, "friction", stepset)
    for i, level in enumerate(own.levels if seen.share_free else ()):
        low, high = own.share_interval(i) or (0.0, 1.0)
        if high - low > 0.5:
            unit = stepset.input_unit
            findings.append(finding("free-share-open", "friction", [level.level], low=low, high=high, unit=unit))
    if values.open.any(axis=0).all():
        findings.append(finding("no-level-determines-all", "friction"))
    part = Friction(share, over, tuple(rows), trends, own.solver)
    return msgspec.structs.replace(part, hold_out=friction_hold_out(part, stepset, task.held_out)), findings


def _of_friction(stepset: StepSet, over: str, x: Array, Ts: Array) -> tuple[list[Finding], list[float | None]]:
    """The coefficient of friction of each level, Eq. (1), where it is known, and why it is not."""
    none: list[float | None] = [None] * len(x)
    if stepset.kind != "friction-force":
        return [], none
    if stepset.output_unit not in TORQUE_UNITS:
        return [finding("output-is-no-torque", "friction", unit=stepset.output_unit)], none
    if over != "stress_kpa":
        return [finding("level-is-no-stress", "friction", unit=stepset.input_unit)], none
    if (rig := stepset.apparatus) is None:
        return [finding("rig-unknown", "friction")], none
    return [], [
        rig.friction_coefficient(one, at) if at > 0 else None for one, at in zip(Ts.tolist(), x.tolist(), strict=True)
    ]


def trend_axis(stepset: StepSet, levels: Array) -> tuple[str, Array]:
    """What the trends run over, and the levels in it: stress [kPa], speed [RPM], or the level's own unit."""
    if stepset.kind == "friction-speed":
        return "speed_rpm", levels
    if stepset.kind == "friction-force" and stepset.input_unit == "N" and (rig := stepset.apparatus) is not None:
        return "stress_kpa", np.array([rig.stress_kpa(force) for force in levels])
    if stepset.kind == "friction-force" and stepset.input_unit in PRESSURE_KPA:
        return "stress_kpa", levels * PRESSURE_KPA[stepset.input_unit]
    return f"level_{stepset.input_unit}".replace("%", "pct"), levels


def friction_hold_out(part: Friction, stepset: StepSet, held_out: Sequence[Level]) -> HoldOut | None:
    """Held-out levels against the curve whose T_s, τ1, τ2 the trends give; None where a trend is missing."""
    if not all(name in part.trends for name in CURVES):
        return None

    def predicted(level: Level) -> Array:
        x = trend_axis(stepset, np.array([level.level]))[1]
        Ts, tau1, tau2 = (float(part.trends[name].predict(x)[0]) for name in CURVES)
        share = SHARE if part.C is None else part.C
        curve = Step(Ts, max(tau1, TAU_FLOOR_S), max(tau2, TAU_FLOOR_S), share)
        return step_response(curve, level.time_s)

    samples, sse = sum(f.samples or 0 for f in part.levels), sum(f.sse or 0.0 for f in part.levels)
    return metrics.hold_out(held_out, predicted, float(np.sqrt(sse / samples)))


def level_findings(values: LevelValues, seen: Scatter | None, subject: str, stepset: StepSet) -> list[Finding]:
    """What the levels leave open: τ1 and τ2 that meet, constraints that hold, τ2 open or beyond the record.

    `seen` is what the levels' runs say about these curves; None: they are those of another estimate.
    """
    unit, u = stepset.input_unit, [level.level for level in values.levels]
    Ts, tau1, tau2 = values.theta[:3]
    met = (tau2 <= tau1 * (1 + MEETING)) & (Ts > 0)
    findings = []

    def where(holds: Mask) -> list[float]:
        return [at for at, there in zip(u, holds, strict=True) if there]

    if met.any():
        taus = tuple(float(f"{tau:.3g}") for tau in tau1[met])
        findings.append(finding("taus-meet", subject, where(met), taus_s=taus, unit=unit))

    cases = {"fast-rise-not-resolved": tau1 <= TAU_FLOOR_S * (1 + MEETING), "output-does-not-rise": Ts <= 0}
    findings += [finding(code, subject, where(holds), unit=unit) for code, holds in cases.items() if holds.any()]
    for name in CURVES:
        holds = np.array([name in held for held in values.held]) & ~(met & (name in TIME_CONSTANTS))
        if holds.any():
            findings.append(finding("parameter-constrained", subject, where(holds), parameter=name, unit=unit))
    records = [float(level.time_s[-1]) for level in values.levels]
    for i in np.flatnonzero(values.open[2]).tolist():
        if "tau2" in values.held[i]:
            continue
        low, high = np.exp(values.low[2, i]), np.exp(min(values.high[2, i], 700.0))
        findings.append(
            finding(
                "tau2-open", subject, [u[i]],
                low_s=float(low) if low > 1e-3 * records[i] else None,
                high_s=float(high) if high < 1e4 * records[i] else None,
                record_s=records[i], curve_half_width=None if seen is None else curve_half_width(seen, i), unit=unit,
                output_unit=stepset.output_unit,
            )
        )  # fmt: skip
    beyond = ~values.open[2] & (tau2 > records)
    if beyond.any():
        longest = float(np.max(np.array(records)[beyond]))
        findings.append(finding("tau2-outlasts-record", subject, where(beyond), record_s=longest, unit=unit))
    return findings


def curve_half_width(scatter: Scatter, i: int) -> float:
    """95 % half-width of one level's output curve within its record, in the output's unit."""
    J = scatter.jacobians[i]
    J = J[np.unique(np.floor(np.geomspace(1, len(J), HALF_WIDTH_ROWS))).astype(int) - 1]
    variance, degrees = Influence(J.T[None], scatter.of_levels.alone(i), np.zeros((0, len(J))), 0.0).variance()
    return float((t_quantile(degrees) * np.sqrt(variance)).max())
