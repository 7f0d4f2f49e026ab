"""What the data do not determine, in words, and whether a model may be used for gains.

A parameter is not determined where its 95 % interval reaches further than a factor of three, or where τ2 outlasts the
record; its range is then told from the profile of the cost, and beside it how well the torque curve itself is known.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from eaid.arrays import Array, median
from eaid.fitting.data import data_of
from eaid.fitting.result import FrictionFit, LinearFit, NonlinearFit
from eaid.fitting.warnings import listed
from eaid.models.trends import FORMS
from eaid.uncertainty.level_statistics import LevelStatistics
from eaid.uncertainty.levels import LevelEstimate, log_jacobian
from eaid.uncertainty.profile import profile_interval
from eaid.uncertainty.student_t import t_quantile

SYMBOLS = {"Ts": "T_s", "tau1": "τ1", "tau2": "τ2", "C": "C"}
UNITS = {"Ts": "N·m", "tau1": "s", "tau2": "s", "C": ""}
TRENDS = {**SYMBOLS, "C_f": "C_f"}
FAR_RECORDS = 10.0
MERGED = "merged-exponential"


@dataclass(frozen=True)
class Verdict:
    """Whether the data determine a model, and what they leave open."""

    identifiable: bool
    reasons: tuple[str, ...]
    """Why not, where not."""
    words: tuple[str, ...]
    """All that is left open, in words."""

    def as_json(self) -> dict[str, Any]:
        """The keys that a model's part of fit.json gets."""
        return {
            "identifiable": self.identifiable,
            "not_identifiable_because": list(self.reasons),
            "open": list(self.words),
        }


def torque_half_width(stats: LevelStatistics, index: int) -> float:
    """95 % half-width of the torque curve within the record of one level [output unit]."""
    one, level = stats.estimates[index], stats.levels[index]
    jacobian = log_jacobian(one.curve, level.time_s, stats.variance.shape[1] == 4)
    t = t_quantile(float(np.min(stats.degrees[index])))
    if one.runs.repeats > 1:
        along = jacobian @ one.runs.influence.T  # what the runs do together, not one parameter after another
        sd = np.sqrt((along**2).sum(axis=1) / (one.runs.repeats - 1) / one.runs.repeats)
        return float(t * sd.max())
    A = one.runs.information
    noise = float(np.mean(one.noise_nm**2))
    memory = np.sqrt(float(np.max(one.runs.within / np.maximum(noise * np.diag(_inverse(A)), 1e-300))))
    sd = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", jacobian, _inverse(A) * noise, jacobian), 0))
    return float(t * memory * sd.max())


def _inverse(A: Array) -> Array:
    return np.asarray(np.linalg.pinv(A, rcond=1e-14, hermitian=True))


def parameter_range(stats: LevelStatistics, index: int, k: int) -> tuple[float, float]:
    """95 % range of one level's parameter from the profile of its cost; an end of 0 or ∞ is none at all."""
    one, level = stats.estimates[index], stats.levels[index]
    spread = float(_inverse(one.runs.information)[k, k])
    t = t_quantile(float(stats.degrees[index, k]))
    within = one.runs.within[k] / one.runs.repeats
    points = data_of([level]).points
    rise = t**2 * max(float(stats.variance[index, k]) if stats.determined[index, k] else within, within) / spread
    own = float(np.mean(one.noise_nm**2)) / one.runs.repeats
    # far from a parabola the linear V says nothing: the cost then rises by the noise's own, with its memory
    rise = min(rise, t**2 * own * _memory(stats, index))
    # far beyond the record the cost is flat: start where it begins to be
    curve = replace(one.curve, tau2=min(one.curve.tau2, FAR_RECORDS * one.runs.duration_s))
    low, high = profile_interval(points, curve, k, rise, stats.variance.shape[1] == 4)
    with np.errstate(over="ignore"):
        return float(np.exp(low)), float(np.exp(high))


def _memory(stats: LevelStatistics, index: int) -> float:
    """How many times larger the best-known parameter's variance is than white noise would make it."""
    one = stats.estimates[index]
    noise = float(np.mean(one.noise_nm**2))
    white = np.diag(_inverse(one.runs.information)) * noise
    ratio = one.runs.within / np.maximum(white, 1e-300)
    return float(max(1.0, np.max(ratio)))


def level_words(stats: LevelStatistics, unit: str, output_unit: str = "N·m") -> list[str]:
    """One sentence for every level that leaves a parameter open, and one for those that seem not to by chance."""
    names = tuple(SYMBOLS)[: stats.variance.shape[1]]
    words = _met_words(stats, unit)
    for i, one in enumerate(stats.estimates):
        place = f"at {one.level:g} {unit}".rstrip()
        met = _met(one)
        for k, name in enumerate(names):
            if met and name in ("tau1", "tau2"):
                continue
            if name in one.constrained:
                words.append(f"{place} {SYMBOLS[name]} is not estimable: a constraint holds it")
            elif not stats.determined[i, k] and name != "C":
                words.append(f"{place} {_range_words(stats, i, k, name, output_unit)}")
    return words + _chance_words(stats, unit)


def _met(one: LevelEstimate) -> bool:
    """Whether τ1 and τ2 of a level are one."""
    return {"tau1", "tau2"} <= set(one.constrained) and "Ts" not in one.constrained


def _met_words(stats: LevelStatistics, unit: str) -> list[str]:
    met = [one for one in stats.estimates if _met(one)]
    if not met:
        return []
    levels, taus = listed([one.level for one in met]), listed([float(f"{one.curve.tau1:.3g}") for one in met])
    place = f"at {levels} {unit}".rstrip()
    return [
        f"{place} τ1 and τ2 meet, neither is estimable by itself: all that the records show is one exponential, of "
        f"{taus} s"
    ]


def _chance_words(stats: LevelStatistics, unit: str) -> list[str]:
    """Levels whose τ2 seems known where most levels leave it open: those are the ones where it came out short."""
    known = stats.determined[:, 2]
    outlasts = ~known & ~np.array([_met(one) for one in stats.estimates])
    if not known.any() or 2 * outlasts.sum() <= len(known):
        return []
    levels = listed(stats.duty_pct[known].tolist())
    return [
        f"at {levels} {unit}".rstrip()
        + " τ2 came out shorter than the record, at most levels it did not: chance or ripple may do that; "
        "do not quote it"
    ]


def _range_words(stats: LevelStatistics, i: int, k: int, name: str, output_unit: str) -> str:
    low, high = parameter_range(stats, i, k)
    record = stats.estimates[i].runs.duration_s
    known = f"{torque_half_width(stats, i):.1g} {output_unit}".rstrip()
    curve = f"the curve itself is known to {known} within the record of {record:.3g} s"
    said = output_unit if name == "Ts" else UNITS[name]
    if not np.isfinite(high) or high > 1000 * record:
        start = f"is {low:.2g} {said} or anything above" if low > 0 else "may be anything"
    else:
        start = f"is anywhere between {low:.2g} and {high:.2g} {said}"
    return f"{SYMBOLS[name]} {start}; {curve}"


def friction_verdict(fit: FrictionFit, stats: LevelStatistics, unit: str, output_unit: str = "N·m") -> Verdict:
    """The levels' curves, a free C, and trends whose rates merged or whose coefficients only count together."""
    words = level_words(stats, unit, output_unit)
    if stats.variance.shape[1] == 4:
        words += _share_words(stats, unit)
    for name, trend in fit.trends.items():
        if trend.form == MERGED:
            words.append(
                f"the two rates of {TRENDS[name]}'s trend cannot be told apart: only their limit (p + q x) e^(r x) "
                "is known"
            )
        elif trend.form == "double-exponential":
            words += _combination(name, np.array(trend.coefficients), np.array(fit.x))
    whole = bool(stats.determined[:, :3].any(axis=0).all())
    reasons = [] if whole else ["no level determines all of T_s, τ1 and τ2"]
    return Verdict(not reasons, tuple(reasons), tuple(words))


def _share_words(stats: LevelStatistics, unit: str) -> list[str]:
    words = []
    for i, one in enumerate(stats.estimates):
        reach = t_quantile(float(stats.degrees[i, 3])) * float(np.sqrt(stats.variance[i, 3]))
        if reach > 1.0:
            low, high = (float(1 / (1 + np.exp(-(one.runs.log_theta[3] + s * reach)))) for s in (-1, 1))
            words.append(
                f"at {one.level:g} {unit} the free C is anywhere between {low:.2f} and {high:.2f}: "
                "C and τ2 trade against each other; hold C"
            )
    return words


def _combination(name: str, c: Array, x: Array) -> list[str]:
    """The combination of a double exponential's coefficients that the levels see least, where it is hardly seen."""
    G = FORMS["double-exponential"].gradient(c, x).T * np.where(c == 0, 1.0, np.abs(c))
    values, vectors = np.linalg.eigh(G.T @ G)
    if values[0] > 1e-6 * values[-1]:
        return []
    weights = vectors[:, 0] / np.abs(vectors[:, 0]).max()
    parts = [
        f"{label} by {100 * w:+.0f} %" for label, w in zip(("p", "r1", "q", "r2"), weights, strict=True) if abs(w) > 0.1
    ]
    return [f"{TRENDS[name]}'s trend hardly changes when {', '.join(parts)} change together: only the curve is known"]


def nonlinear_verdict(fit: NonlinearFit, stats: LevelStatistics, unit: str, output_unit: str = "N·m") -> Verdict:
    """Levels too few for the polynomials, parameters that most levels leave open, constraints that hold."""
    count = len(stats.levels)
    reasons, words = [], level_words(stats, unit, output_unit)
    if count == 1:
        reasons.append("one level only: nothing says how T_s, τ1 and τ2 change with the duty; record more levels")
    elif count < 4:
        words.append(
            f"{count} levels pin the polynomials of T_s, τ1, τ2 exactly or not at all: nothing checks their shape"
        )
    for k, name in enumerate(("Ts", "tau1", "tau2")):
        open_at = [level.level for level, known in zip(stats.levels, stats.determined[:, k], strict=True) if not known]
        if 2 * len(open_at) > count:
            reasons.append(
                f"{SYMBOLS[name]} is not determined at {len(open_at)} of {count} levels: "
                + _why_open(stats, open_at, name)
            )
    if fit.solver.at_bounds:
        words.append(f"a constraint holds {_ranges(fit.solver.at_bounds)}: not estimable there")
    if fit.share_free:
        words.append(
            f"C is free ({fit.parameters.C:.3g}): it trades against τ2 wherever the record is not several τ2 long, and "
            "T_s and τ2 are less sure for it; hold C unless the data ask for another"
        )
    return Verdict(not reasons, tuple(reasons), tuple(words))


def _why_open(stats: LevelStatistics, open_at: Sequence[float], name: str) -> str:
    """Why most levels leave a parameter open, and what to do where recording longer helps."""
    met = sum(_met(one) for one in stats.estimates if one.level in open_at)
    if 2 * met > len(open_at):
        return "one exponential is all that most of them show"
    longest = max(one.runs.duration_s for one in stats.estimates)
    return f"hold each level longer than {longest:.3g} s" if name == "tau2" else "the records do not show it"


def _ranges(at_bounds: tuple[str, ...]) -> str:
    shown = ", ".join(at_bounds[:4])
    return shown if len(at_bounds) <= 4 else f"{shown} and {len(at_bounds) - 4} more"


def linear_verdict(fit: LinearFit, stats: LevelStatistics, ci95: dict[str, list[float]]) -> Verdict:
    """b0 and c0 of one level, an a0 or b0 that may be zero, levels without a B."""
    reasons, words = [], []
    if len(stats.levels) == 1:
        reasons.append(
            "one level only: one step cannot tell b0 from c0, only b0 u + c0 is known; record a second level"
        )
    a0, b0 = ci95.get("a0"), ci95.get("b0")
    if a0 is not None and a0[0] <= 0:
        reasons.append(f"a0 may be zero (95 % interval {a0[0]:.3g} to {a0[1]:.3g} 1/s): the records are too short")
    if b0 is not None and b0[0] <= 0 and len(stats.levels) > 1:
        reasons.append(
            f"b0 may be zero or negative (95 % interval {b0[0]:.3g} to {b0[1]:.3g}): the duty's effect is not seen"
        )
    if fit.bounds.B_m is None:
        reasons.append("no level has a positive b0, so B has no bounds")
    words.append(
        "one level's step gives b0 u + c0 only; its b0 rests on the convention "
        f"{fit.bounds.convention}" + ("" if len(stats.levels) > 1 else ", and so does the pooled one")
    )
    return Verdict(not reasons, tuple(reasons), tuple(words))


def scatter_words(stats: LevelStatistics) -> list[str]:
    """What the scatter of the runs itself says: single runs, scatter that is not alike over the levels."""
    if stats.source == "within":
        return [
            "one run a level and too few levels to see run-to-run scatter: the intervals hold one run's own noise only "
            "and are too narrow; repeat each level three times"
        ]
    if stats.source == "curve":
        return [
            "one run a level: the scatter was taken from the levels' distance to the curve; trust the curve more than "
            "single levels, and repeat each level to tell scatter from a wrong curve"
        ]
    assert stats.scatter is not None
    words = []
    if stats.swept:
        shifted = [SYMBOLS[n] for n, c in zip(SYMBOLS, stats.scatter.common, strict=False) if c > 0]
        sweeps = stats.scatter.common_degrees + 1
        runs = sum(one.runs.repeats for one in stats.estimates)
        words.append(
            f"the repeats look like {sweeps:.0f} sweeps: all levels of one share a shift of {' and '.join(shifted)}; "
            f"the {runs} runs count as {sweeps:.0f} there, intervals are wider; record levels in random order instead"
        )
    scatter = stats.scatter
    for name, jump, a, v in zip(SYMBOLS, scatter.jumps, scatter.between, scatter.pooled.T, strict=False):
        repeated = a > 0.3 * median(v) * stats.estimates[0].runs.repeats  # else it is noise, not scatter
        if jump is not None and repeated:
            last, first = (stats.levels[jump.place + i].level for i in (0, 1))
            here = f"up to {last:g} than above" if jump.ratio > 1 else f"from {first:g} on than below"
            words.append(
                f"the runs' scatter of {SYMBOLS[name]} is {max(jump.ratio, 1 / jump.ratio):.2g} times larger {here}: "
                "the intervals follow it; more repeats there would narrow them most"
            )
    return words
