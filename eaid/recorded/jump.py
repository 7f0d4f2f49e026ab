"""A sensor whose zero jumps within a log: the output is higher by a number from an instant on, whatever the input does.

A fit puts such a jump into T_s, falls and a slow part without end. It is looked for where an input is held: there the
residuals' mean goes further, from some rows to as many behind them, than anywhere else (a drift goes nowhere at once).
Its size is then that of least squares beside all unknowns, s̃'r̃/s̃'s̃, r̃ and s̃ being the residuals and a step at that
instant without what the unknowns can explain of them.
"""

from collections.abc import Sequence

import numpy as np

from eaid.arrays import Array, means_of
from eaid.estimate.recorded_log import RecordedLog
from eaid.findings import Finding, finding
from eaid.recorded.from_logs import Solved, plant_found
from eaid.steps.noise import resolution

MOST_JUMP_ROWS = 20_000  # Means of a log by which it is looked for, or somewhat more
SIDES = (10, 30, 100)  # Rows on either side of a jump whose means are compared
SHARPEST = 2.0  # Times further than elsewhere that the mean goes there
BEHIND_CHANGES = 2.0  # Times τ1 behind a change of the input in which a model may be wrong as suddenly
LEAST_JUMPED = 0.01  # Part of what an output spans that a jump makes at least
NEAR_ENDS = 0.02  # Part of a log at either end in which none is looked for


def find_jump(solved: Solved, k: int) -> tuple[float, float] | None:
    """When the zero of log k of a fit may jump [s since its first row], and by how much; None where it does not."""
    log, plant = solved.logs[k], plant_found(solved)
    left, _, rows = _free_of_unknowns(solved, k)
    known, n, ends = np.flatnonzero(np.isfinite(log.output)), len(left), int(NEAR_ENDS * len(left))
    whole, y = np.append(0.0, np.cumsum(left)), solved.outputs[k]
    least = max(LEAST_JUMPED * float(np.ptp(y)), resolution(y))  # no jump is less than a step of the sensor
    changes = np.unique(np.searchsorted(known, log.changes[1:]) // rows).tolist() if log.stepwise else []
    moving = int(BEHIND_CHANGES * float(plant.time_constants(max(plant.u_range))[0]) / (rows * log.usual_s))
    for side in SIDES:
        calm = np.zeros(n, dtype=bool)  # Where the input has been held for long enough, and is
        calm[max(side, ends) : n - max(side, ends)] = True
        for change in changes:
            calm[max(change - side, 0) : change + side + moving + 1] = False
        if not calm.any():
            continue
        means, further = (whole[side:] - whole[:-side]) / side, np.zeros(n)
        further[side : n - side + 1] = means[side:] - means[:-side]
        row = int(np.argmax(np.abs(further) * calm))
        calm[max(row - 2 * side, 0) : row + 2 * side + 1] = False
        if calm.any() and abs(further[row]) > max(SHARPEST * float(np.abs(further[calm]).max()), least):
            return float(log.time_s[known[row * rows]] - log.time_s[0]), float(further[row])
    return None


def jump_size(solved: Solved, k: int, at_s: float) -> float:
    """By how much the output of log k of a fit jumps at an instant [s since its first row]."""
    log, (left, square, rows) = solved.logs[k], _free_of_unknowns(solved, k)
    since_s = log.time_s[np.isfinite(log.output)][::rows][: len(left)] - log.time_s[0]
    row = int(np.argmin(np.abs(since_s - at_s)))
    return float(left[row:].sum() / square[row])


def _free_of_unknowns(solved: Solved, k: int) -> tuple[Array, Array, int]:
    """Recorded less model of a log without what its unknowns explain, (n,), what these leave of the square of a step at
    each row, (n,), and how many rows each is the mean of."""
    rows, means, begun = max(1, len(solved.outputs[k]) // MOST_JUMP_ROWS), list[Array](), None
    for block in solved.setup.derivatives(solved.x, k):
        whole = block if begun is None else np.concatenate([begun, block])
        means.append(means_of(whole, rows))
        begun = whole[len(whole) // rows * rows :]
    J = np.concatenate(means)
    r = -J[:, -1] / solved.logs[k].weight ** 0.5
    basis = np.linalg.qr(J[:, :-1] / np.maximum(np.linalg.norm(J[:, :-1], axis=0), 1e-300))[0]
    behind = np.cumsum(basis[::-1], axis=0)[::-1]
    square = len(r) - np.arange(len(r)) - np.sum(behind**2, axis=1)
    return r - basis @ (basis.T @ r), np.maximum(square, 1e-9), rows


def jump_findings(logs: Sequence[RecordedLog], unit: str) -> list[Finding]:
    """What is said of each log whose zero jumps."""
    jumped = [log for log in logs if log.jump[1]]
    return [finding("zero-jumps", log.name, at_s=log.jump[0], size=log.jump[1], unit=unit) for log in jumped]
