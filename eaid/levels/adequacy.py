"""Is the model right, are the runs alike? Lack of fit, decay under hold, odd repeats, the C that the runs ask for."""

from collections.abc import Sequence
from dataclasses import replace

import msgspec
import numpy as np
from scipy.special import fdtri, stdtrit

from eaid.arrays import Array, median
from eaid.estimate.data import Data, explains_little
from eaid.estimate.forms import Model, friction
from eaid.estimate.scatter import CURVES, Scatter, common_shifts
from eaid.estimate.spread import interval_of, t_quantile
from eaid.findings import Finding, finding
from eaid.levels.certainty import Estimate
from eaid.levels.each_level import OwnLevels, own_levels
from eaid.levels.from_steps import fit_levels_first
from eaid.levels.session_drift import session_drift
from eaid.plant.forms import RESTING
from eaid.results.models import LackOfFit, ShareEstimate
from eaid.steps.noise import block_means, fit_line
from eaid.steps.step import PEAK_PART, hold_of, moving_means, whole_means
from eaid.steps.stepset import Level, RunRecord

OVERSHOOT = 0.05  # Output lost under hold beyond which no monotone curve is right
DECAY_CHANCE = 0.01  # Probability at which noise alone would be told to be a decay under hold
SINGLE_CHANCE = 0.001  # The same for a single run, whose peak the same noise has chosen
SINGLE_DEGREES = 4.0  # Degrees of freedom given to the scatter of a single smoothed run
# Levels that all repeats have to miss alike, where there are so many: ripple of a rotor does it at one by chance
FEWEST_MISSED = 3
HELD_MISSED_FAR = 0.015  # Part of the held output, in the middle, by which they miss it so that no interval holds it
ODD_REPEAT = 0.01  # Probability at which a good repeat would be said to lie off the others
SWEEPS_APART = 3.0  # Times the distance between the other sweeps that one of them is off
LEAST_OFF = 0.05  # Distance in ln τ below which nothing is said of a repeat
FEWEST_LEVELS, NEAR_0 = 3, 0.5  # Levels that tell an exponent; the largest one that is rather 0 than 1


def decays(levels: Sequence[Level]) -> list[tuple[float, float]]:
    """(level, percent of the peak lost) where the output falls under hold by more than `OVERSHOOT` and than chance.

    The peak of a run is looked for in the other runs, so that noise does not make one. The falls of the runs of a level
    are then compared with what they scatter, pooled over the levels (t test, one in a hundred), and what the smoothed
    mean scatters about a straight line after the peak, which is more at low levels; the fall of a single run with the
    latter alone (one in a thousand).
    """
    falls = [_losses_under_hold(level) for level in levels]
    spare = sum(len(fall) - 1 for fall in falls)
    pooled = sum(float(((fall - fall.mean()) ** 2).sum()) for fall in falls) / max(spare, 1)
    falling = []
    for level, fall in zip(levels, falls, strict=True):
        smooth = whole_means(level.mean, PEAK_PART)
        if (peak := float(smooth.max())) <= 0:
            continue
        after = smooth[int(smooth.argmax()) :: max(1, len(level.mean) // PEAK_PART)]
        left = fit_line(np.arange(len(after)), after).left if len(after) >= 4 else np.full(4, np.inf)
        own = np.sqrt(2 * (left @ left) / (len(left) - 2)) / peak
        error = max(own if len(after) >= 4 else 0.0, np.sqrt(pooled / len(fall)))
        degrees, chance = float(spare), DECAY_CHANCE
        if len(fall) == 1:
            error, degrees, chance = own, SINGLE_DEGREES, SINGLE_CHANCE
        least = max(OVERSHOOT, float(t_quantile(degrees, 1 - 2 * chance) * error))
        if fall.mean() > least and (peak - float(smooth[-1])) / peak > OVERSHOOT:
            falling.append((level.level, hold_of(level.runs).lost_pct))
    return falling


def _losses_under_hold(level: Level) -> Array:
    """What each run loses from its peak to its end, relative to the peak, shape (R,)."""
    smooth = whole_means(level.runs, PEAK_PART)
    others = smooth if len(smooth) == 1 else smooth.sum(axis=0) - smooth
    peak = np.take_along_axis(smooth, others.argmax(axis=1)[:, None], axis=1)[:, 0]
    return np.asarray((peak - smooth[:, -1]) / np.maximum(np.abs(peak), 1e-300))


def lack_of_fit(level: Level, noise: Array) -> LackOfFit | None:
    """Whether the runs of one level miss their own curves in the same way; None for a single run.

    `noise` are their residuals, (R, n). `ratio` is R Σ ē² / (Σ_r Σ (e_r − ē)²/(R − 1)): 1 for a right model, whatever
    the colour of the noise.
    """
    runs = len(noise)
    if runs < 2:
        return None
    common = noise.mean(axis=0)
    off = noise - common
    apart = float(np.vdot(off, off)) / (runs - 1)
    ratio = runs * float(common @ common) / apart if apart > 0 else 1.0
    power = np.abs(np.fft.rfft(off)) ** 2  # degrees of freedom of coloured noise, (Σ P)²/Σ P²; two for a sine
    squares = (power**2).sum(axis=1)
    known = 2 * power.sum(axis=1) ** 2 / np.where(squares > 0, squares, 1.0)
    count = float(np.mean(np.where(squares > 0, known, off.shape[1])))
    chance = float(fdtri(count, count * (runs - 1), 0.999))
    systematic = float(np.sqrt(np.mean(common**2) * max(0.0, 1 - 1 / ratio))) if ratio > 0 else 0.0
    return LackOfFit(level.level, ratio, chance, bool(ratio > chance), systematic)


def rise_of_the_rig(levels: Sequence[Level]) -> list[Finding]:
    """Whether the levels rise at one rate, as a stand loads its output, and not at T_s/τ, as a plant does.

    log slope = a + e log T_s over the levels, the slope of the rise from 10 to 50 % of the peak: e is 1 where τ is a
    constant of the plant, and 0 where the stand moves at its own rate. Told where the interval of e leaves out 1 by
    half and e is near 0.
    """
    if len(levels) < FEWEST_LEVELS:
        return []
    held = np.array([float(hold_of(level.runs).held.mean()) for level in levels])
    slopes = np.array([np.mean([_slope(level.time_s, run) for run in level.runs]) for level in levels])
    if not (held > 0).all() or not (slopes > 0).all() or held.max() < 2 * held.min():
        return []
    e, error, _ = fit_line(np.log(held), np.log(slopes))
    low, high = interval_of(e, error**2, len(held) - 2.0)
    if abs(e) > NEAR_0 or high > NEAR_0:
        return []
    times = float(held.max() / held.min())
    return [finding("rise-of-the-rig", "friction", [one.level for one in levels], e=e, low=low, high=high, times=times)]


def _slope(time_s: Array, run: Array) -> float:
    """Slope of a run from 10 to 50 % of its peak."""
    smooth = moving_means(run[None], max(1, len(run) // 200))[0]
    top = smooth.max()
    low = int(np.argmax(smooth >= 0.1 * top))
    high = max(int(np.argmax(smooth >= 0.5 * top)), low + 1)
    return fit_line(time_s[low : high + 1], smooth[low : high + 1]).slope


def adequacy(scatter: Scatter, unit: str) -> tuple[tuple[LackOfFit, ...], list[Finding]]:
    """Judge the shape of the levels' curves."""
    pairs = zip(scatter.levels, scatter.noise, strict=True)
    rows = [row for row in (lack_of_fit(level, noise) for level, noise in pairs) if row]
    falling, findings = decays(scatter.levels), rise_of_the_rig(scatter.levels)
    if falling:
        worst, lost = max(falling, key=lambda pair: pair[1])
        values = {"worst": worst, "lost_pct": lost, "of": len(scatter.levels)}
        findings.append(finding("output-decays-under-hold", "friction", [u for u, _ in falling], unit=unit, **values))
    beyond = [row for row in rows if row.beyond]
    told = len(beyond) >= min(FEWEST_MISSED, len(rows)) and 3 * len(beyond) > len(rows)
    if told and 2 * len(falling) <= len(scatter.levels):
        most = max(beyond, key=lambda row: row.systematic_nm or 0.0)
        held = {one.level: float(hold_of(one.runs).held.mean()) for one in scatter.levels}
        part = median(np.array([(row.systematic_nm or 0.0) / abs(held[row.level] or np.inf) for row in beyond]))
        size = {"systematic": most.systematic_nm, "worst": most.level, "of": len(rows), "far": part > HELD_MISSED_FAR}
        alike = finding("repeats-miss-alike", "friction", [row.level for row in beyond], **size)
        findings.append(msgspec.structs.replace(alike, severity="caution") if part > HELD_MISSED_FAR else alike)
    return tuple(rows), findings


def scatter_findings(scatter: Scatter, runs: Sequence[RunRecord]) -> list[Finding]:
    """What the scatter of the runs itself says: single runs; a drift of the session, or sweeps where there is none."""
    if scatter.source != "repeats":
        return [finding("single-runs" if scatter.source == "curve" else "single-runs-few-levels", "data")]
    found = [*odd_repeats(scatter), *(drift := session_drift(scatter, runs))]
    if scatter.swept and not drift:
        shifted = tuple(name for name, common in zip(CURVES, scatter.pooled.common, strict=False) if common > 0)
        sweeps, count = int(scatter.repeats.max()), int(scatter.repeats.sum())
        found.append(finding("recorded-as-sweeps", "data", sweeps=sweeps, parameters=shifted, runs=count))
    return found


def no_steps(scatter: Scatter) -> list[Finding]:
    """Levels that no step response explains: those whose output stays at rest, and others."""
    pairs = zip(scatter.levels, scatter.jacobians, strict=True)  # ∂f/∂ln T_s is f itself
    little = {one.level for one, J in pairs if explains_little([one.mean], [one.mean - J[:, 0]])}
    tops = {one.level: float(np.abs(block_means(one.mean)).max()) for one in scatter.levels}
    still = {u for u in little if tops[u] <= RESTING * max(tops.values())}
    found = {"output-stays-at-rest": sorted(still), "curve-explains-little": sorted(little - still)}
    return [finding(code, "friction", levels) for code, levels in found.items() if levels]


def odd_repeats(scatter: Scatter) -> list[Finding]:
    """One repeat of three or more whose τ1 or τ2 lies off the others', at one level, or in sweeps at all of them.

    Its distance to the others' mean against the scatter of all runs but it, a t test at `ODD_REPEAT` in all; in sweeps
    against what is left of the levels, and `SWEEPS_APART` times what the other sweeps lie apart.
    """
    findings = []
    for k, name in ((1, "tau1"), (2, "tau2")):
        size = np.sqrt(scatter.pooled.expected[:, k] * scatter.repeats)  # how far single runs of each level scatter
        rows = [i for i, one in enumerate(scatter.runs) if scatter.usable[i, k] and len(one.shift) > 2]
        sweeps = common_shifts(scatter.runs, k) if len(rows) == len(scatter.levels) else None
        off_all = [scatter.runs[i].shift[:, k] - (0.0 if sweeps is None else sweeps) for i in rows]
        squares = sum(float(d @ d) / size[i] ** 2 for i, d in zip(rows, off_all, strict=True))
        degrees = sum(len(d) - 1 for d in off_all) - (1 if sweeps is None else len(sweeps) - 1)
        limit = float(stdtrit(degrees, 1 - ODD_REPEAT / 4 / sum(map(len, off_all)))) if degrees > 0 else np.inf
        groups = [([i], d) for i, d in zip(rows, off_all, strict=True)] if sweeps is None else [(rows, sweeps)]
        for at, d in groups:
            r, scale = int(np.abs(d - median(d)).argmax()), float(np.sqrt(np.mean(size[at] ** 2) / len(at)))
            others = np.delete(d, r)
            off = float(d[r] - others.mean())
            left = squares - (off / scale) ** 2 * len(others) / len(d) if sweeps is None else squares
            error = scale * np.sqrt(max(left, 0.0) / max(degrees, 1) * len(d) / len(others))
            apart = 0.0 if sweeps is None else SWEEPS_APART * float(np.ptp(others))
            if abs(off) > max(limit * error, apart, LEAST_OFF):
                runs, levels = (tuple(getattr(scatter.levels[i], what) for i in at) for what in ("names", "level"))
                pct, names = float(100 * np.expm1(off)), tuple(one[r] for one in runs)
                findings.append(finding("repeat-is-off", "data", levels, runs=names, parameter=name, off_pct=pct))
    return findings


VAGUE = 0.1  # Half-width of C beyond which the runs say hardly anything of it
SHIFT_MATTERS = 0.25  # Part of a half-width: a shift by so much takes 4 of the 95 % from an interval
TRIFLE = 0.0025  # A difference in C that is never worth a word: 3 % in τ2 and 0.3 % in T_s on the reference plant
NUDGE = 0.002  # Change of C by which its effect is found


def share_of(near: Estimate | OwnLevels, data: Data) -> tuple[ShareEstimate, list[Finding]]:
    """Does the C that was held fit this rig? The same estimate with one free C for all levels beside it."""
    held, levels = float(near.scatter.theta[3, 0]), near.levels
    if isinstance(near, OwnLevels):
        (low, high, _), x = near.intervals, near.scatter.theta[1:3].ravel()
        form: Model | None = replace(friction(data.u, None), Ts=None)
        moved = [own_levels(levels, data, held + side * NUDGE, near).scatter.theta for side in (-1, 1)]
    else:
        (low, high, _), x, form = near.intervals(data.u), near.solved.x, None
        moved = [fit_levels_first(data, held + side * NUDGE, [x]).at.theta for side in (-1, 1)]
    free = Estimate(levels, fit_levels_first(data, None, [np.append(x, held)], form))
    influence, holding = free.of_levels, set(free.solved.held)
    if form is not None:  # levels share nothing but C
        influence = replace(influence, single_degrees=max(len(levels) - 1.0, 1.0))
        holding &= {"C-zero", "C-one"}
    variance, degrees = (float(one[-1]) for one in influence.variance())
    C, half = np.nan if holding else float(free.solved.x[-1]), 0.5 * (high - low)
    before, after = (np.log(np.maximum(theta[:3], 1e-300)) for theta in moved)
    slope = (after - before) / (2 * NUDGE)
    sensitivity = {name: median(slope[k]) for k, name in enumerate(CURVES)}  # in % per 0.01, the slope itself
    reach = float(t_quantile(degrees) * np.sqrt(variance))
    if not reach <= 0.5 or not np.isfinite(C):
        return ShareEstimate(held, sensitivity), [
            finding("runs-leave-the-share-open", "friction", held=held, estimate=None, low=0.0, high=1.0)
        ]
    ends = (max(0.0, C - reach), min(1.0, C + reach))
    rejected = not ends[0] <= held <= ends[1]
    matters = rejected and abs(C - held) >= TRIFLE and bool((np.abs(slope * (C - held)) > SHIFT_MATTERS * half).any())
    findings = []
    if matters or ends[1] - ends[0] > 2 * VAGUE:
        code = "runs-reject-the-share" if matters else "runs-leave-the-share-open"
        findings.append(finding(code, "friction", (), held=held, estimate=C, low=ends[0], high=ends[1]))
    return ShareEstimate(held, sensitivity, C, ends, degrees, rejected, matters), findings
