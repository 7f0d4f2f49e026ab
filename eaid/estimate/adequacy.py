"""Is the model right? Lack of fit against the spread of the repeats, decay under hold, the C that the runs ask for."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.special import fdtri

from eaid.arrays import Array, median
from eaid.estimate.certainty import Estimate
from eaid.estimate.data import Data
from eaid.estimate.friction import LevelValues
from eaid.estimate.from_steps import fit_levels_first
from eaid.estimate.levels import OwnLevels, own_levels
from eaid.estimate.scatter import (
    CURVES,
    Scatter,
    log_jacobian,
    of_numbers,
    pooled_scatter,
    run_residuals,
    run_statistics,
)
from eaid.estimate.spread import Influence, t_quantile
from eaid.findings import Finding, finding
from eaid.results.fit import LackOfFit, ShareEstimate
from eaid.steps.noise import line
from eaid.steps.stepset import Level

OVERSHOOT = 0.05  # Output lost under hold beyond which no monotone curve is right
CHANCE = 0.01  # Probability at which noise alone would be told to be a decay under hold
SINGLE_CHANCE = 0.001  # The same for a single run, whose peak the same noise has chosen
SINGLE_DEGREES = 4.0  # Degrees of freedom given to the scatter of a single smoothed run
# Levels that all repeats have to miss alike, where there are so many: ripple of a rotor does it at one by chance
FEW = 3


def overshoot(level: Level) -> float:
    """Share of its peak that the mean output loses while the input is held, smoothed over a fiftieth of the record."""
    smooth = _smooth(level.mean)
    peak = float(smooth.max())
    return float((peak - smooth[-1]) / peak) if peak > 0 else 0.0


def _smooth(values: Array) -> Array:
    """Moving means over a fiftieth of the record, along the last axis."""
    width = max(1, values.shape[-1] // 50)
    sums = np.cumsum(np.concatenate([np.zeros((*values.shape[:-1], 1)), values], axis=-1), axis=-1)
    return np.asarray((sums[..., width:] - sums[..., :-width]) / width)


def decays(levels: Sequence[Level]) -> list[tuple[float, float]]:
    """(level, share of the peak lost) where the output falls under hold by more than `OVERSHOOT` and than chance.

    The peak of a run is looked for in the other runs, so that noise does not make one. The falls of the runs of a level
    are then compared with what they scatter, pooled over the levels (t test, one in a hundred); the fall of a single
    run with what its own smoothed output scatters about a straight line after the peak (one in a thousand).
    """
    falls = [_falls(level) for level in levels]
    spare = sum(len(fall) - 1 for fall in falls)
    pooled = sum(float(((fall - fall.mean()) ** 2).sum()) for fall in falls) / max(spare, 1)
    falling = []
    for level, fall in zip(levels, falls, strict=True):
        lost = overshoot(level)
        error = np.sqrt(pooled / len(fall)) if len(fall) > 1 else _single_error(level)
        degrees, chance = (float(spare), CHANCE) if len(fall) > 1 else (SINGLE_DEGREES, SINGLE_CHANCE)
        if lost > OVERSHOOT and fall.mean() > t_quantile(degrees, 1 - 2 * chance) * error:
            falling.append((level.level, lost))
    return falling


def _falls(level: Level) -> Array:
    """What each run loses from its peak to its end, relative to the peak, shape (R,)."""
    smooth = _smooth(level.runs)
    others = smooth if len(smooth) == 1 else smooth.sum(axis=0) - smooth
    peak = np.take_along_axis(smooth, others.argmax(axis=1)[:, None], axis=1)[:, 0]
    return np.asarray((peak - smooth[:, -1]) / np.maximum(np.abs(peak), 1e-300))


def _single_error(level: Level) -> float:
    """Standard error of the fall of a single run, from its smoothed output about a line after the peak."""
    smooth = _smooth(level.mean)
    after = smooth[int(smooth.argmax()) :: max(1, len(level.mean) // 50)]
    if len(after) < 4 or smooth.max() <= 0:
        return np.inf
    left = line(np.arange(len(after)), after).left
    return float(np.sqrt(2 * (left @ left) / (len(after) - 2)) / smooth.max())


def spectral_degrees(residual: Array) -> float:
    """Degrees of freedom of a sum of squares of coloured noise, (Σ P)²/Σ P² over its spectrum P; two for a sine."""
    z = np.fft.rfft(residual)
    power = z.real**2 + z.imag**2
    total = float((power**2).sum())
    return float(2 * power.sum() ** 2 / total) if total > 0 else float(len(residual))


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
    count = float(np.mean([spectral_degrees(run) for run in off]))
    chance = float(fdtri(count, count * (runs - 1), 0.999))
    systematic = float(np.sqrt(np.mean(common**2) * max(0.0, 1 - 1 / ratio))) if ratio > 0 else 0.0
    return LackOfFit(level.level, ratio, chance, bool(ratio > chance), systematic)


def adequacy(scatter: Scatter, unit: str) -> tuple[tuple[LackOfFit, ...], list[Finding]]:
    """Judge the shape of the levels' curves."""
    pairs = zip(scatter.levels, scatter.noise, strict=True)
    rows = [row for row in (lack_of_fit(level, noise) for level, noise in pairs) if row]
    falling, findings = decays(scatter.levels), []
    if falling:
        worst, lost = max(falling, key=lambda pair: pair[1])
        values = {"worst": worst, "lost_pct": 100 * lost, "of": len(scatter.levels)}
        findings.append(finding("output-decays-under-hold", "friction", [u for u, _ in falling], unit=unit, **values))
    beyond = [row for row in rows if row.beyond]
    told = len(beyond) >= min(FEW, len(rows)) and 3 * len(beyond) > len(rows)
    if told and 2 * len(falling) <= len(scatter.levels):
        most = max(beyond, key=lambda row: row.systematic_nm or 0.0)
        size = {"systematic": most.systematic_nm, "worst": most.level, "of": len(rows)}
        findings.append(finding("repeats-miss-alike", "friction", [row.level for row in beyond], **size))
    return tuple(rows), findings


VAGUE = 0.1  # Half-width of C beyond which the runs say hardly anything of it
MATTERS = 0.25  # Part of a half-width: a shift by so much takes 4 of the 95 % from an interval
TRIFLE = 0.0025  # A difference in C that is never worth a word: 3 % in τ2 and 0.3 % in T_s on the reference plant
NUDGE = 0.002  # Change of C by which its effect is found
STEPS, SETTLED = 12, 1e-5
LEAST, MOST = 0.02, 0.99  # Where C cannot be told, it runs out of here


def share_of(first: Estimate) -> tuple[ShareEstimate, list[Finding]]:
    """Does the C that was held fit this rig? The same estimate with C free beside it."""
    held, levels, data = first.model.share, first.levels, first.problem.data
    assert held is not None

    def at(share: float) -> Array:
        return np.log(np.maximum(fit_levels_first(data, share, [first.x]).at.theta[:3], 1e-300))

    free = Estimate(levels, fit_levels_first(data, None, [np.append(first.x, held)]))
    last = np.eye(1, free.model.size, free.model.size - 1)
    variance, degrees = (float(one[0]) for one in free.influence.of(last).variance())
    low, high, _ = first.intervals(data.u)
    return _judged(held, at, np.nan if free.held else float(free.x[-1]), variance, degrees, 0.5 * (high - low))


def share_of_levels(own: OwnLevels, data: Data, values: LevelValues) -> tuple[ShareEstimate, list[Finding]]:
    """The same where every level was fitted by itself: one C for all of them.

    With z = ∂f/∂C of a level less what its T_s, τ1 and τ2 can follow, C is where Σ w z'(ȳ − f) is 0, w the inverse of
    the mean squared output; a run moves it by w z'(y_r − ȳ)/(R Σ w z'z).
    """
    held, now = own.each[0].model.share, own
    assert held is not None
    near = {held: own}

    def at(share: float) -> Array:
        near.setdefault(share, own_levels(own.levels, data, share, own))
        return np.log(np.maximum(near[share].theta[:3], 1e-300))

    share, step, before, information = held, 1.0, np.inf, 0.0
    for _ in range(STEPS):
        slopes = [log_jacobian(curve, level.time_s, True) for curve, level in zip(now.curves, own.levels, strict=True)]
        ways = [J[:, 3] - J[:, :3] @ np.linalg.lstsq(J[:, :3], J[:, 3], rcond=1e-10)[0] for J in slopes]
        weight = [1 / max(float(np.mean(level.mean**2)), 1e-300) for level in own.levels]
        left = [level.mean - J[:, 0] for level, J in zip(own.levels, slopes, strict=True)]
        scores = np.array([w * float(z @ r) for w, z, r in zip(weight, ways, left, strict=True)])
        information = max(sum(w * float(z @ z) for w, z in zip(weight, ways, strict=True)), 1e-300)
        step = float(np.clip(scores.sum() / information, -1.0, 1.0)) * share * (1 - share)  # of C, from its logit
        if 0.1 < abs(step / before) < 0.9:  # T_s, τ1 and τ2 follow: steps shrink by a ratio, which leads to their sum
            step /= 1 - step / before
        if abs(step) < SETTLED or not LEAST < share + step < MOST:
            break
        share, before = share + step, step
        now = own_levels(own.levels, data, share, now)
    single = [len(level.runs) == 1 for level in own.levels]
    if all(single):
        variance, degrees = float((scores**2).sum()) / information**2, max(len(scores) - 1.0, 1.0)
    else:
        rows = zip(own.levels, slopes, ways, strict=True)
        noise = [(level, run_residuals(level.runs, J[:, 0], J), z / max(float(z @ z), 1e-300)) for level, J, z in rows]
        scatter = of_numbers(pooled_scatter([run_statistics(level, one, way[:, None]) for level, one, way in noise]))
        gain = np.array([w * float(z @ z) for w, z in zip(weight, ways, strict=True)])[:, None, None] / information
        variance, degrees = (float(one[0]) for one in Influence(gain, scatter, np.zeros((0, 1)), 0.0).variance())
    settled = share if abs(step) < SETTLED else np.nan
    size = (share * (1 - share)) ** 2
    return _judged(held, at, settled, variance * size, degrees, 0.5 * (values.high - values.low))


def _judged(
    held: float, at: Callable[[float], Array], C: float, variance: float, degrees: float, half: Array
) -> tuple[ShareEstimate, list[Finding]]:
    """What is told of the C that was held, given the one that the runs ask for; NaN where they ask for none.

    `at` gives ln T_s, ln τ1, ln τ2 of the levels at a C, (3, L); `half` are the half-widths of their intervals.
    """
    slope = (at(held + NUDGE) - at(held - NUDGE)) / (2 * NUDGE)
    sensitivity = {name: median(slope[k]) for k, name in enumerate(CURVES)}  # in % per 0.01, the slope itself
    reach = float(t_quantile(degrees) * np.sqrt(variance))
    if not reach <= 0.5 or not np.isfinite(C):
        return ShareEstimate(held, sensitivity), [
            finding("runs-leave-the-share-open", "friction", held=held, estimate=None, low=0.0, high=1.0)
        ]
    ends = (max(0.0, C - reach), min(1.0, C + reach))
    rejected = not ends[0] <= held <= ends[1]
    matters = rejected and abs(C - held) >= TRIFLE and bool((np.abs(slope * (C - held)) > MATTERS * half).any())
    findings = []
    if matters or ends[1] - ends[0] > 2 * VAGUE:
        code = "runs-reject-the-share" if matters else "runs-leave-the-share-open"
        findings.append(finding(code, "friction", (), held=held, estimate=C, low=ends[0], high=ends[1]))
    return ShareEstimate(held, sensitivity, C, ends, degrees, rejected, matters), findings
