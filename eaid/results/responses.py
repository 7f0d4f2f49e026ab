"""What a clutch is bought for, level by level, measured on the recorded steps themselves; no model is asked.

    held       mean of the last tenth of the hold          engaged   time below 90 % of it
    peak       largest value, where the output slips back  slip      peak less held
    released   time above 10 % of held, after the release

Each is measured in every run, on means over so many samples that white noise is left at 1 % of the held output (the
peak: over a fiftieth of the record, at the instant where the mean of the runs has it). A time is how long the output is
short of its mark until it first is well beyond it, so that noise about the mark cancels. The value is the mean of the
runs; its 95 % interval is by Student's t from what runs differ, as a share: of times those of the level itself, of
outputs those of all levels. A model would not do here: fitted curves that rise have no peak. On synthetic runs (three
of a level, 150 sets) intervals held the noiseless value in 93 to 95 % (held), 87 to 93 % (engaged) and 95 to 99 %
(released).
"""

import math
from collections.abc import Sequence

import numpy as np
from scipy.special import stdtrit

from eaid.arrays import Array
from eaid.findings import Finding
from eaid.results.common import Count, Interval, Number, Result
from eaid.steps.step import PEAK_PART, hold_of, moving_means
from eaid.steps.stepset import Level, StepSet

ENGAGED, RELEASED = 0.9, 0.1  # Shares of the held output
WIDEST = 2.3  # Half-width of a logarithm, a factor of ten, beyond which an interval says nothing
NOISE = 0.01  # Share of the held output that noise may be of means
OF_SLIPS, TIMES = ("peak", "peak_s", "slip"), ("engaged_s", "peak_s", "released_s")


class ResponseIntervals(Result, frozen=True):
    """95 % intervals of one level's response."""

    held: Interval = None
    engaged_s: Interval = None
    peak: Interval = None
    peak_s: Interval = None
    slip: Interval = None
    released_s: Interval = None


class LevelResponse(Result, frozen=True):
    """How the output of one level comes, stays and goes; None: not reached within the record, or no slip."""

    level: Number
    runs: Count
    held: Number | None = None
    """Mean of the last tenth of the hold."""
    engaged_s: Number | None = None
    """From the step to 90 % of `held`."""
    peak: Number | None = None
    peak_s: Number | None = None
    """Time of the peak since the step."""
    slip: Number | None = None
    """Peak less held."""
    released_s: Number | None = None
    """From the release to 10 % of `held`."""
    ci95: ResponseIntervals | None = None


def responses_of(steps: StepSet, findings: Sequence[Finding]) -> tuple[LevelResponse, ...]:
    """The response of each level; a peak only at those levels whose output was found to decay under hold."""
    slipping = {u for one in findings if one.code == "output-decays-under-hold" for u in one.levels}
    falls = {one.level: one for one in steps.releases}
    measured = [_measured(one, falls.get(one.level)) for one in steps.levels]
    spreads = {name: _pooled_spread(measured, name) for name in ResponseIntervals.__struct_fields__}
    rows = zip(steps.levels, measured, strict=True)
    return tuple(_response_row(one, each, spreads, one.level in slipping) for one, each in rows)


def _response_row(
    level: Level, measured: dict[str, Array], spreads: dict[str, tuple[float, float]], slips: bool
) -> LevelResponse:
    values: dict[str, float] = {}
    ends: dict[str, Interval] = {}
    for name in spreads:
        found = measured[name]
        if len(found) == 0 or not np.isfinite(found).all() or (name in OF_SLIPS and not slips):
            continue
        values[name], (sd, dof) = float(found.mean()), spreads[name]
        if name in TIMES:  # runs of one level differ in them as its own noise has it
            sd, dof = _pooled_spread([measured], name)
        reach = float(stdtrit(dof, 0.975)) * sd / math.sqrt(len(found)) if dof > 0 else 0.0
        if 0 < reach < WIDEST:
            ends[name] = (values[name] * math.exp(-reach), values[name] * math.exp(reach))
            if name == "slip":
                reach *= float(measured["held"].mean())
                ends[name] = (values[name] - reach, values[name] + reach)
    sign = float(measured["sign"][0])
    for name in {"held", "peak", "slip"} & values.keys():
        values[name] *= sign
        if (pair := ends.get(name)) is not None:
            ends[name] = (min(sign * pair[0], sign * pair[1]), max(sign * pair[0], sign * pair[1]))
    return LevelResponse(level.level, len(level.runs), **values, ci95=ResponseIntervals(**ends) if ends else None)


def _measured(level: Level, release: Level | None) -> dict[str, Array]:
    """Every quantity of every run; NaN where it is not reached."""
    sign = -1.0 if level.mean[-max(1, len(level.mean) // 10) :].mean() < 0 else 1.0
    runs, time = sign * level.runs, level.time_s
    _, peak, held = hold_of(runs)
    tops = moving_means(runs, max(1, runs.shape[1] // PEAK_PART)).argmax(axis=1)
    found = {
        "sign": np.array([sign]), "held": np.where(held > 0, held, np.nan),
        "engaged_s": np.array([_below(time, run, ENGAGED * end, end) for run, end in zip(runs, held, strict=True)]),
        "peak": peak, "peak_s": time[tops], "slip": peak - held,
        "released_s": np.empty(0),
    }  # fmt: skip
    if release is not None:
        end, falling = float(held.mean()), sign * release.runs
        gone = [_below(release.time_s, end - run, (1 - RELEASED) * end, end) for run in falling]
        found["released_s"] = np.array(gone)
    return found


def _below(time: Array, output: Array, wanted: float, held: float) -> float:
    """How long the output is below a value until it first is well beyond it, up to the middle of its crossings by noise
    [s]; NaN: to the end."""
    if not held > 0 or output[-max(1, len(output) // 10) :].mean() < wanted:
        return math.nan
    tail = np.diff(output[-max(2, len(output) // 10) :])
    noise = float(tail.std()) / math.sqrt(2) if len(tail) > 1 else 0.0
    width = min(max(1, math.ceil((noise / (NOISE * held)) ** 2)), max(1, len(output) // 20))
    lasts = np.diff(time, append=2 * time[-1] - time[-2])
    smooth = moving_means(output[None], width)[0]
    beyond = np.flatnonzero(smooth >= (wanted + held) / 2)  # what rings comes below it again
    first = int(beyond[0]) if len(beyond) else len(smooth)
    return float(lasts[:first][smooth[:first] < wanted].sum())


def _pooled_spread(measured: list[dict[str, Array]], name: str) -> tuple[float, float]:
    """Standard deviation of one run from its level's mean, as a share, pooled over levels, and degrees of freedom."""
    squares, dof = 0.0, 0
    for each in measured:
        found = each[name]
        shares = found / each["held"] if name == "slip" else np.log(np.where(found > 0, found, np.nan))
        if len(found) > 1 and np.isfinite(shares).all():
            squares, dof = squares + float(((shares - shares.mean()) ** 2).sum()), dof + len(found) - 1
    return (math.sqrt(squares / dof) if dof else 0.0), float(dof)
