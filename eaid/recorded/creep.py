"""An output that creeps beside its response, as that of a sensor which warms up:

    y = response + a s + 4 b s (1 − s),   s the share of the log that is over, a and b its own

A slow part without end, falls that differ and a hysteresis imitate a creep, so that it is asked for beside the plant
that was chosen: where it saves more squares than noise does, everything is fitted anew to logs without it. It stays an
unknown of the fit, and its freedom is in the intervals.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from eaid.arrays import Array, means_of, scaled_inverse
from eaid.estimate.recorded_log import RecordedLog, creep_at, take_off_creep, take_off_drift
from eaid.estimate.solver import approach
from eaid.estimate.spread import t_quantile
from eaid.findings import Finding, finding
from eaid.levels.creep import SHARE_CHANCE
from eaid.plant.sums import lagged
from eaid.recorded.engagements import FEWEST_ENGAGEMENTS, gains_of_engagements
from eaid.recorded.from_logs import Solved, fit_near, fit_setup, idle_found, setup_of
from eaid.recorded.kinds import noise_saves
from eaid.recorded.log_intervals import Spread, spread
from eaid.steps.noise import effective_samples

LEAST_PART, MOST_PART = 0.004, 0.2  # Of what an output spans, that a creep makes of it by the end of its log
GAIN_DRIFT_CHANCE = 0.01  # That gains of engagements which scatter alone go so with time
LEAST_GAIN, SURE_GAIN = 0.03, 0.001  # Part by which a gain drifts over a log that is told, and to which it is found
GUESSED_LAGS, GUESSED_SURELY = (0.002, 0.01, 0.05), 3.0  # Parts of a log; standard errors of a creep that is guessed
GUESSED_ROWS = 20_000  # Means of a log by which it is guessed, or somewhat more
LED_ASTRAY = 0.5  # Squares with a creep over those without, up to which a fit without it was led astray
MOST_BENT = 0.7  # Of that, amid the log: half where it warms up at once


def add_creeps(solved: Solved, logs: Sequence[RecordedLog]) -> Solved:
    """A fit with the creeps of all logs as unknowns, 0 so far."""
    setup = replace(solved.fitted, creeping=len(logs))
    own = (np.append(solved.x[place.own[place.own >= 0]], [0.0, 0.0]) for place in solved.fitted.places)
    return replace(solved, fitted=setup, x=np.concatenate([solved.x[: setup.shared], *own]))


def creeps_of(solved: Solved) -> Array:
    """The creeps of the logs, (L, 2)."""
    return np.array([solved.x[place.own[3:]] for place in solved.fitted.places])


def find_creeps(tried: Sequence[Solved], logs: Sequence[RecordedLog]) -> Array:
    """Creeps that the logs show beside the plant that was chosen, the first, or the clutch, (L, 2); zeros where noise
    explains them, or they are no creep: little, much, or there and back."""
    left, nothing = tried[0].fitted.problem().value(tried[0].x)[0], np.zeros((len(logs), 2))
    begun = [add_creeps(one, logs) for one in tried]
    ends = [replace(one, x=end.x, cost=end.cost) for one in begun for end in [approach(one.fitted.problem(), one.x)]]
    free = min(ends, key=lambda one: one.cost)
    if left - free.cost <= max(noise_saves(free, 2 * len(logs)), free.fitted.problem().floor):
        return nothing
    creeps = creeps_of(free)
    parts = [np.abs(one) / np.ptp(log.output[np.isfinite(log.output)]) for one, log in zip(creeps, logs, strict=True)]
    straight, bent = max(parts, key=lambda one: one[0])
    return creeps if LEAST_PART < straight < MOST_PART and bent < MOST_BENT * straight else nothing


def find_far_creeps(clutch: Solved, logs: Sequence[RecordedLog], gains: Array | None) -> Array:
    """Creeps so large that a fit without them has been led astray, (L, 2): from where the input behind some lags leaves
    them the clutch's form explains the logs far better, and than with `gains` that drift; zeros where it does not."""
    guessed, fitted = np.array([[guess_creep(log), 0.0] for log in logs]), clutch.fitted
    if not guessed.any() or fitted.model.kind != "parallel":
        return np.zeros_like(guessed)
    plain = [take_off_creep(log, one) for log, one in zip(logs, guessed, strict=True)]
    begun = add_creeps(fit_setup(setup_of(fitted.model, plain, fitted.idle_free, fitted.dead_time_s)), plain)
    end = approach(begun.fitted.problem(), begun.x)
    far = end.cost < LED_ASTRAY * clutch.cost
    if far and gains is not None:
        idles = [idle_found(clutch, k) + (log.baseline or 0.0) for k, log in enumerate(logs)]
        steady = [take_off_drift(*one) for one in zip(logs, gains.tolist(), idles, strict=True)]
        other = fit_setup(setup_of(fitted.model, steady, fitted.idle_free, fitted.dead_time_s))
        far = end.cost < other.cost
    return guessed + creeps_of(replace(begun, x=end.x)) if far else np.zeros_like(guessed)


def guess_creep(log: RecordedLog) -> float:
    """How far an output creeps beside a cubic of its input behind some lags, by least squares over means of rows; 0
    where noise explains it."""
    rows, lasts_s = max(1, len(log.input) // GUESSED_ROWS), float(log.time_s[-1] - log.time_s[0])
    size = np.abs(log.input).max()
    powers = np.column_stack([means_of((log.input / size) ** k, rows) for k in (1, 2, 3)])
    share, y = (means_of(one, rows) for one in ((log.time_s - log.time_s[0]) / lasts_s, log.output))
    usual_s = rows * log.usual_s
    behind = [lagged(powers, usual_s, part * lasts_s) for part in GUESSED_LAGS]
    known = np.isfinite(y)
    columns = np.column_stack([share, np.ones_like(share), *behind])[known]
    y = y[known]
    r = y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0]
    back = scaled_inverse(columns.T @ columns)
    creep, independent = float(back[0] @ columns.T @ y), effective_samples(r, usual_s)
    error = float(np.sqrt(back[0, 0] * (r @ r) / independent))
    return creep if abs(creep) > max(GUESSED_SURELY * error, LEAST_PART * float(np.ptp(y))) else 0.0


def find_gain_drift(tried: Sequence[Solved], least: float = LEAST_GAIN) -> Array | None:
    """By what part the gain of each log grows from its begin to its end, (L,), by one linear step of the fit of some
    that is explained best so; None where noise, or an output that creeps, explains as much or more, or it is little.

        y = (1 + g (s − ½)) response
    """
    best, (_, gains, ahead) = min(((one, _fit_drift(one)) for one in tried), key=lambda one: one[1][0])
    return gains if ahead and max(map(abs, gains)) > least and not _scatter_explains(best) else None


def _scatter_explains(solved: Solved) -> bool:
    """Whether gains that differ from engagement to engagement go with time no more than scatter makes them: a t test of
    their line, of logs that hold several. Of inputs that move all the time few engagements tell nothing: what a chirp's
    frequency does goes with time, too."""
    parts = []
    for k, drive in enumerate(solved.setup.drives):
        T, starts, _, gain, loaded = gains_of_engagements(solved, k)
        share = np.cumsum(drive.dt_s)[drive.w > 0] / float(drive.dt_s.sum())
        at = (np.add.reduceat(share, starts) / np.diff(np.append(starts, len(T))))[loaded]
        parts.append((at - at.mean(), gain[loaded] - gain[loaded].mean()))
    t, d = (np.concatenate(one) for one in zip(*parts, strict=True))
    spare = float(len(t) - len(parts) - 1)
    if spare < FEWEST_ENGAGEMENTS - 2:
        return not all(one.log.stepwise for one in solved.setup.copies)
    slope, size = float(t @ d) / float(t @ t), float(t @ t)
    error = np.sqrt(float((d - slope * t) @ (d - slope * t)) / spare / size)
    return bool(abs(slope) < t_quantile(spare, 1 - GAIN_DRIFT_CHANCE) * error)


def _fit_drift(solved: Solved) -> tuple[float, Array, bool]:
    """What a fit leaves with gains that drift, these, and whether they explain more than noise and creeps do."""
    plain, gains, saved, left, independent = hold_creeps(solved), list[float](), np.zeros(2), 0.0, 0.0
    setup, x = plain.fitted, plain.x
    for k, drive in enumerate(setup.drives):
        J, r = setup.jacobian(x, k)
        root, idle = np.sqrt(drive.w[drive.w > 0]), int(setup.places[k].own[0])
        response = r + root * (drive.y[drive.w > 0] - (x[idle] if idle >= 0 else 0.0))
        share = setup.over[k]
        creep = root[:, None] * creep_at(share)
        basis = np.linalg.qr(J / np.maximum(np.linalg.norm(J, axis=0), 1e-300))[0]
        for n, columns in enumerate((creep, (response * (share - 0.5))[:, None])):
            alone = columns - basis @ (basis.T @ columns)
            step = -np.linalg.lstsq(alone, r, rcond=1e-10)[0]
            after = r + alone @ step
            saved[n] += float(r @ r) - float(after @ after)
        gains.append(float(step[0]))
        left += float(after @ after)
        independent += effective_samples(after, float(drive.dt_s.sum()) / len(after))
    by_noise = float(chdtri(len(gains), SHARE_CHANCE)) * left / max(independent, 1.0)
    return left, np.array(gains), bool(saved[1] > max(saved[0], by_noise))


def refit_with_creeps(solved: Solved, logs: Sequence[RecordedLog]) -> tuple[Solved, tuple[RecordedLog, ...]]:
    """The fit with the creeps of its logs at their end, and the logs without them: of these they are 0."""
    free = add_creeps(solved, logs)
    ended = fit_near(free.fitted, free.x)
    plain = tuple(take_off_creep(log, one) for log, one in zip(logs, creeps_of(ended), strict=True))
    before, x = ended.fitted, ended.x.copy()
    x[[place.own[3:] for place in before.places]] = 0.0
    as_left, extras = before.falls_as_left, before.extras
    setup = setup_of(before.model, plain, before.idle_free, before.dead_time_s, as_left, extras, len(logs))
    return replace(ended, fitted=setup, x=x), plain


def hold_creeps(solved: Solved) -> Solved:
    """The fit without its creeps as unknowns, which a part of a log or another model would tell otherwise."""
    gone = np.concatenate([place.own[3:] for place in solved.fitted.places])
    return replace(solved, fitted=replace(solved.fitted, creeping=0), x=np.delete(solved.x, gone[gone >= 0]))


def sure(solved: Solved, logs: Sequence[RecordedLog]) -> bool:
    """Whether the noise, coloured as it is, makes some of the creeps as rarely as `SHARE_CHANCE`."""
    known, unknowns = spread(solved), np.eye(solved.setup.size)
    for log, place in zip(logs, solved.setup.places, strict=True):
        for creep, at in zip(log.creep, place.own[3:], strict=True):
            variance, degrees = known.variance(unknowns[at])
            if abs(creep) > t_quantile(degrees, 1 - SHARE_CHANCE) * np.sqrt(variance):
                return True
    return False


def creep_findings(solved: Solved, logs: Sequence[RecordedLog], known: Spread | None, unit: str) -> list[Finding]:
    """What is said of each log whose creep was taken off: how far it went by the end, with its 95 % interval, and amid
    the log."""
    found = []
    for log, place in zip(logs, solved.setup.places, strict=False):
        straight, bent = log.creep
        if place.own[3] >= 0 and (straight or bent):
            half = 0.0 if known is None else known.of(np.eye(solved.setup.size)[place.own[3]])
            low, high, middle = straight - half, straight + half, straight / 2 + bent
            found.append(finding("log-creeps", log.name, end=straight, low=low, high=high, middle=middle, unit=unit))
    return found
