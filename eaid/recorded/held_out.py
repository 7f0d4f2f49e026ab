"""What a fit of recorded logs makes of what it has not seen: one log of several in turn, or a third of a single one.

The same model is fitted without that part, from where the whole fit ended, and run through it, driven by the input
alone. Of both parts 100 (1 − rms residual/rms output about its mean), the mean of all that was recorded. Nothing is
said of a part whose inputs lie beyond those of the others: that would be about extrapolation. A part that is missed by
far is no witness where the whole fit explains the others as well as their own does: they do not tell the model.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from eaid.arrays import Array, Mask
from eaid.estimate.recorded_log import RecordedLog
from eaid.estimate.solver import approach
from eaid.levels.unseen import judge_unseen
from eaid.plant.drive import AT_IDLE
from eaid.plant.forms import PerLevel, pieces_through, piecewise
from eaid.recorded.creep import hold_creeps
from eaid.recorded.from_logs import Setup, Solved, setup_of
from eaid.recorded.inputs import BEYOND_INPUTS
from eaid.results.recorded import LogsHeldOut

THIRDS = ("last", "middle", "first")
MOST_FOLDS = 4  # Of several logs
INPUTS_APART = 1000  # Parts of the largest input, in two of which two are not the same
AGREES = 0.02  # Part by which the whole fit may leave more of the others than their own
PART_SETTLED = 1e-6  # Part of the cost that a further step would gain, at which the fit without a part stands


def held_out(solved: Solved, logs: Sequence[RecordedLog]) -> LogsHeldOut | None:
    """How the model holds on what a fit without it has not seen; None where no part can be left out."""
    if any(log.reference is not None for log in logs):  # its duty answers the noise: one log's is no other's
        return None
    solved, folds = hold_creeps(solved), list[tuple[str, float, int, bool]]()
    curve = solved.setup.model.Ts
    for named, rows in _parts_left_out(logs, 0 if curve is None else curve.size):
        part = [replace(log, output=np.where(out, np.nan, log.output)) for log, out in zip(logs, rows, strict=True)]
        missed, agrees = _missed(solved, part)
        seen = [out[np.isfinite(log.output)] for out, log in zip(rows, logs, strict=True)]
        squares = sum(float(one[rows] @ one[rows]) for one, rows in zip(missed, seen, strict=False))
        folds.append((named, squares, sum(int(one.sum()) for one in seen), agrees))
    count = sum(map(len, solved.outputs))
    mean = sum(float(y.sum()) for y in solved.outputs) / count
    size = float(np.sqrt(sum(float(np.sum((y - mean) ** 2)) for y in solved.outputs) / count))
    rms = float(np.sqrt(sum(float(left @ left) for left in solved.missed) / count))
    if not folds or not size > 0:
        return None
    told = _judge_folds(folds, size, rms)
    if judge_unseen(told.fit_pct, told.held_pct, told.of):  # by parts whose rest tells the model
        folds = [one for one in folds if not one[-1]]
        return _judge_folds(folds, size, rms) if folds else None
    return told


def _judge_folds(folds: Sequence[tuple[str, float, int, bool]], size: float, rms: float) -> LogsHeldOut:
    """Of some parts left out: name, squares, samples."""
    names, squares, counts, _ = zip(*folds, strict=True)
    held = float(np.sqrt(sum(squares) / sum(counts)))
    return LogsHeldOut(names[-1], 100 * (1 - rms / size), 100 * (1 - held / size))


def _parts_left_out(logs: Sequence[RecordedLog], terms: int) -> Iterator[tuple[str, list[Mask]]]:
    """What is left out of each log, one fit after another, and its name; T_s(u) has so many `terms`."""
    nothing = [np.zeros(len(log.input), dtype=bool) for log in logs]
    if len(logs) > 1:
        folds = min(len(logs), MOST_FOLDS)
        for fold in range(folds):
            rows = [none | (k % folds == fold) for k, none in enumerate(nothing)]
            if _inputs_within(logs, rows, terms):
                yield "logs", rows
        return
    (log,) = logs
    share = (log.time_s - log.time_s[0]) / (log.time_s[-1] - log.time_s[0])
    for name, low in zip(THIRDS, (2 / 3, 1 / 3, 0.0), strict=True):
        rows = [(share >= low) & (share <= low + 1 / 3)]
        if _inputs_within(logs, rows, terms):
            yield f"{name} third", rows
            return


def _inputs_within(logs: Sequence[RecordedLog], rows: Sequence[Mask], terms: int) -> bool:
    """Whether the inputs left out lie within the others, which move, too, and are as many as T_s(u) has terms."""
    out = np.concatenate([log.input[one] for log, one in zip(logs, rows, strict=True)])
    seen = np.concatenate([log.input[~one] for log, one in zip(logs, rows, strict=True)])
    if not len(seen) or not len(out) or np.ptp(seen) == 0:
        return False
    top = float(np.abs(seen).max())
    held = np.bincount(np.round(INPUTS_APART * np.abs(seen) / top).astype(np.intp))
    if np.count_nonzero(held[1:]) < terms:
        return False
    beyond = BEYOND_INPUTS * top
    return bool(out.min() >= seen.min() - beyond and out.max() <= seen.max() + beyond)


def _missed(solved: Solved, part: Sequence[RecordedLog]) -> tuple[list[Array], bool]:
    """Model less recorded at all rows that have an output, by a fit to a part; and whether the whole fit explains that
    part as well."""
    fitted = solved.fitted
    kept = [k for k, log in enumerate(part) if np.isfinite(log.output).any()]
    own = [one.own[one.own >= 0] for one in fitted.places]
    at = np.concatenate([np.arange(fitted.shared), *(own[k] for k in kept)]).astype(np.intp)
    x = solved.x.copy()
    remains, as_left = [part[k] for k in kept], fitted.falls_as_left
    problem = setup_of(fitted.model, remains, fitted.idle_free, fitted.dead_time_s, as_left, fitted.extras).problem()
    end, before = approach(problem, x[at], near=PART_SETTLED), problem.value(x[at])[0]
    x[at] = end.x
    _bridge_unseen(x, fitted, remains)
    every = fitted.every
    missed = []
    for k, drive in enumerate(every.drives):
        its = every.places[k].kernel[AT_IDLE:]
        its = its[its >= 0]
        if k in kept or not len(its):
            r = every.residuals(x, k)
        else:  # its idle output and start are not the model's
            J, r = every.jacobian(x, k)
            r = r - J[:, its] @ np.linalg.lstsq(J[:, its], r, rcond=None)[0]
        missed.append(r / np.sqrt(drive.w[drive.w > 0]))
    return missed, before <= (1 + AGREES) * end.cost + problem.floor


def _bridge_unseen(x: Array, fitted: Setup, kept: Sequence[RecordedLog]) -> None:
    """Give T_s of levels that the other logs do not hold as the curve through those that they do has it."""
    if not isinstance(form := fitted.model.Ts, PerLevel):
        return
    held = np.concatenate([log.input[np.isfinite(log.output)] for log in kept])
    seen = form.rows(held[held > 0]).any(axis=0)  # a rest tells no level
    if not seen.any():
        return
    through = pieces_through(tuple(zip(form.inputs[seen].tolist(), x[: form.size][seen].tolist(), strict=True)))
    x[: form.size][~seen] = piecewise(through, form.inputs[~seen], (fitted.model.low, fitted.model.high))
