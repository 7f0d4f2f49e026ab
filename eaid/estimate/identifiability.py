"""What the data do not determine, as findings, and whether a model may be used for gains.

A parameter is open where the 95 % interval of its logarithm reaches further than a factor of three, and τ2 also where
the runs allow one beyond the record. Beside the range of τ2 stands how well the output curve itself is known.
"""

from collections.abc import Sequence

import numpy as np

from eaid.arrays import Array
from eaid.estimate.level_statistics import CURVES, NAMES, LevelEstimate, LevelStatistics, log_jacobian
from eaid.estimate.runs import Mask, t_quantile
from eaid.findings import Finding, Value, finding
from eaid.models.trends import FORMS
from eaid.results.fit import NOT_IDENTIFIABLE, Estimate, Friction, Linear, PooledIntervals

TAUS = {"tau1", "tau2"}


def identifiable(found: Sequence[Finding]) -> bool:
    """Whether the data determine a model of which these findings are said, so that it may be used for gains."""
    return not any(warning.code in NOT_IDENTIFIABLE for warning in found)


def torque_half_width(stats: LevelStatistics, i: int) -> float:
    """95 % half-width of the output curve within the record of one level [output unit]."""
    estimate = stats.estimates[i]
    runs = estimate.runs
    jacobian = log_jacobian(estimate.curve, stats.levels[i].time_s, stats.share_free)
    if runs.repeats > 1:
        along = jacobian @ runs.influence.T  # what the runs do together, not one parameter after another
        sd = np.sqrt((along**2).sum(axis=1) / (runs.repeats - 1) / runs.repeats)
    else:
        noise = float(np.mean(estimate.noise_nm**2)) * estimate.memory
        sd = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", jacobian, runs.inverse * noise, jacobian), 0))
    return float(t_quantile(float(np.min(stats.degrees[i]))) * sd.max())


def level_findings(stats: LevelStatistics, subject: str, unit: str, output_unit: str) -> list[Finding]:
    """What single levels leave open: τ1 and τ2 that meet, constraints that hold, τ2 open or beyond the record."""
    findings = []
    met = [estimate for estimate in stats.estimates if _taus_met(estimate)]
    if met:
        taus = tuple(float(f"{estimate.curve.tau1:.3g}") for estimate in met)
        findings.append(finding("taus-meet", subject, [estimate.level for estimate in met], taus_s=taus, unit=unit))
    for name in NAMES[: stats.variance.shape[1]]:
        held = [estimate for estimate in stats.estimates if name in estimate.constrained]
        at = [estimate.level for estimate in held if not (name in TAUS and _taus_met(estimate))]
        if at:
            findings.append(finding("parameter-constrained", subject, at, parameter=name, unit=unit))
    findings += [_open_tau2(stats, i, subject, unit, output_unit) for i in np.flatnonzero(stats.open_tau2).tolist()]
    known = [estimate for estimate, known in zip(stats.estimates, stats.determined[:, 2], strict=True) if known]
    beyond = [estimate for estimate in known if estimate.curve.tau2 > estimate.runs.duration_s]
    if beyond:
        longest = max(estimate.runs.duration_s for estimate in beyond)
        at = [estimate.level for estimate in beyond]
        findings.append(finding("tau2-outlasts-record", subject, at, record_s=longest, unit=unit))
    return findings


def _taus_met(estimate: LevelEstimate) -> bool:
    """Whether τ1 and τ2 of a level are one."""
    return set(estimate.constrained) >= TAUS and "Ts" not in estimate.constrained


def _open_tau2(stats: LevelStatistics, i: int, subject: str, unit: str, output_unit: str) -> Finding:
    runs = stats.estimates[i].runs
    low, high = stats.tau2_sets.tau2_s[i]
    return finding(
        "tau2-open",
        subject,
        [runs.level],
        low_s=float(low) if np.isfinite(low) and low > 0 else None,
        high_s=float(high) if np.isfinite(high) else None,
        record_s=runs.duration_s,
        curve_half_width=torque_half_width(stats, i),
        unit=unit,
        output_unit=output_unit,
    )


def friction_findings(fit: Friction, stats: LevelStatistics, unit: str, output_unit: str) -> list[Finding]:
    """The levels' curves, a free C, and trends whose coefficients only count together."""
    findings = level_findings(stats, "friction", unit, output_unit)
    if stats.share_free:
        findings += _free_share_findings(stats, unit)
    for name, trend in fit.trends.items():
        if trend.form == "double-exponential":
            findings += _combination(name, np.array(trend.coefficients), np.array(fit.x))
    if not stats.determined[:, :3].any(axis=0).all():
        findings.append(finding("no-level-determines-all", "friction"))
    return findings


def _free_share_findings(stats: LevelStatistics, unit: str) -> list[Finding]:
    findings = []
    for i, estimate in enumerate(stats.estimates):
        reach = t_quantile(float(stats.degrees[i, 3])) * float(np.sqrt(stats.variance[i, 3]))
        if reach > 1.0:
            logit = estimate.runs.log_theta[3]
            low, high = (float(1 / (1 + np.exp(-(logit + s * reach)))) for s in (-1, 1))
            findings.append(finding("free-share-open", "friction", [estimate.level], low=low, high=high, unit=unit))
    return findings


def _combination(name: str, c: Array, x: Array) -> list[Finding]:
    """The combination of a double exponential's coefficients that the levels see least, where it is hardly seen."""
    G = FORMS["double-exponential"].gradient(c, x).T * np.where(c == 0, 1.0, np.abs(c))
    values, vectors = np.linalg.eigh(G.T @ G)
    if values[0] > 1e-6 * values[-1]:
        return []
    weights = vectors[:, 0] / np.abs(vectors[:, 0]).max()
    changes: dict[str, Value] = {
        label: 100 * float(w) for label, w in zip(("p", "r1", "q", "r2"), weights, strict=True) if abs(w) > 0.1
    }
    return [finding("coefficients-together", "friction", (), parameter=name, **changes)]


def nonlinear_findings(
    fit: Estimate, stats: LevelStatistics, unit: str, output_unit: str, wide: Mask, with_levels: bool
) -> list[Finding]:
    """Levels too few for the polynomials, parameters that are open (`wide`, (3, L)) at most levels; single levels."""
    count = len(stats.levels)
    findings = level_findings(stats, "nonlinear", unit, output_unit) if with_levels else []
    if count == 1:
        findings.append(finding("one-level-nonlinear", "nonlinear", [stats.levels[0].level]))
    elif count < 4:
        findings.append(finding("few-levels-for-polynomials", "nonlinear", count=count))
    for open_there, name in zip(wide, CURVES, strict=True):
        open_at = [level.level for level, there in zip(stats.levels, open_there, strict=True) if there]
        if 2 * len(open_at) > count:
            why = _why_open(stats, open_at, name)
            findings.append(finding("parameter-open-at-most-levels", "nonlinear", open_at, **why))
    if fit.C_free:
        findings.append(finding("share-free", "nonlinear", C=fit.C))
    return findings


def _why_open(stats: LevelStatistics, open_at: Sequence[float], name: str) -> dict[str, Value]:
    """Which parameter, at how many levels, and why: one exponential, a short record, or the records as they are."""
    met = sum(_taus_met(estimate) for estimate in stats.estimates if estimate.level in open_at)
    longest = max(estimate.runs.duration_s for estimate in stats.estimates)
    cause = "one-exponential" if 2 * met > len(open_at) else "short-record" if name == "tau2" else "records"
    return {"parameter": name, "count": len(open_at), "of": len(stats.levels), "cause": cause, "record_s": longest}


def linear_findings(fit: Linear, stats: LevelStatistics, ci95: PooledIntervals) -> list[Finding]:
    """b0 and c0 of one level, an a0 or b0 that may be zero, levels without a B."""
    several = len(stats.levels) > 1
    findings = [finding("b0-by-convention", "linear", several=several)]
    if not several:
        findings.append(finding("one-level-linear", "linear", [stats.levels[0].level]))
    for name in ("a0", "b0") if several else ("a0",):
        ends = getattr(ci95, name)
        if ends is not None and ends[0] <= 0:
            findings.append(finding(f"{name}-may-be-zero", "linear", low=ends[0], high=ends[1]))
    if fit.bounds is None or fit.bounds.B_m is None:
        findings.append(finding("no-b-bounds", "linear"))
    return findings


def scatter_findings(stats: LevelStatistics) -> list[Finding]:
    """What the scatter of the runs itself says: single runs, sweeps."""
    if stats.source != "repeats":
        return [finding("single-runs" if stats.source == "curve" else "single-runs-few-levels", "data")]
    assert stats.scatter is not None
    findings, scatter = [], stats.scatter
    if stats.swept:
        shifted = tuple(name for name, common in zip(NAMES, scatter.common, strict=False) if common > 0)
        runs = sum(estimate.runs.repeats for estimate in stats.estimates)
        sweeps = int(scatter.common_degrees + 1)
        findings.append(finding("recorded-as-sweeps", "data", sweeps=sweeps, parameters=shifted, runs=runs))
    return findings
