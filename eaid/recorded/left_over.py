"""Whether what a model leaves of its logs follows their input: then it is no noise, and the rig has what the model
has not, as a play, dry friction, hysteresis or a curve of another form.

The residuals are regressed on functions of the input as it acts, raw and behind the plant's fast lag: u, u |u|, u³ for
curves, the sign of its last change, that times |u|, and u through plays, for what goes by its direction. What they
explain of the residuals, less what they would of noise with as many independent samples as what they leave has, is told
where it is much, and seen in the output. So is what follows how the input has just changed, which a filter makes that
no dead time is: u less itself behind quick lags.

And whether the input is seen in the output at all: what wanders by itself is explained to 70 % by a slow lag of any
input. Output and model are freed of what an autoregression of the output foresees, so that what is left of a drift
knows no input, and the one is regressed on the other: the slope of a rig whose input acts is many of its errors off 0.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from eaid.arrays import Array, Mask, means_of, scaled_inverse
from eaid.estimate.recorded_log import RecordedLog
from eaid.findings import Finding, finding
from eaid.plant.sums import follow_play, lagged, unforeseen
from eaid.recorded.from_logs import Solved, plant_found
from eaid.recorded.late import ORDER, autoregression
from eaid.steps.noise import effective_samples

PLAYS = (0.1, 0.3, 0.6)  # Widths, in parts of the input's range
FUNCTIONS, OF_SIZE = 5 + len(PLAYS), 3  # Of the input, and those of its size among them
MUCH = 0.15  # Part of the residuals' squares, beyond chance
CLEAR_SD = 5.0  # Errors of the slope: of random walks, with models fitted to them, 4.3 at most (40), of rigs 8 at least
WINDOWS = (0.0, 0.05, 0.2, 0.5)  # Of the slowest lag, over which both are averaged before; that counts which shows most
FEWEST_MEANS, MOST_MEANS, MOST_COUNTED_ROWS = 100, 20_000, 200_000
# Part of the output's standard deviation that the part explained has at least, and that which goes by the changes
LEFT_SEEN, CHANGES_SEEN = 0.03, 0.01
QUICKER = (1 / 3, 1 / 10)  # Parts of τ1, lags that tell how an input has just changed


def left_over_findings(solved: Solved, logs: Sequence[RecordedLog]) -> list[Finding]:
    """Said where what a model leaves follows the input."""
    plant, theta_s = plant_found(solved), solved.fitted.dead_time_of_plant(solved.x)
    tau_s = float(np.mean(plant.time_constants(max(plant.u_range))[0]))
    size, parts, sums = 0.0, [], np.zeros((2 * FUNCTIONS + 1, 2 * FUNCTIONS + 1))
    for log, r in itertools.starmap(thin_out, zip(logs, solved.missed, strict=False)):
        known, dt_s = np.isfinite(log.output), log.usual_s
        columns = np.stack([*(one[known] for one in functions_of(log, theta_s, tau_s, dt_s)), r], axis=1)
        columns -= columns.mean(axis=0)
        parts.append((columns, dt_s))
        sums += columns.T @ columns
        size += float(np.var(log.output[known])) * len(columns)
    A, along, total = sums[:-1, :-1], sums[:-1, -1], float(sums[-1, -1])
    if not total > 0:
        return []
    follows, independent = scaled_inverse(A, 1e-10) @ along, 0.0
    for columns, dt_s in parts:
        left = columns[:, -1] - columns[:, :-1] @ follows
        independent += effective_samples(left, dt_s)

    def share(of: Mask) -> float:  # beyond what noise would give
        if independent <= 2 * of.sum():
            return -np.inf
        back = scaled_inverse(A[np.ix_(of, of)], 1e-10)
        return float(along[of] @ back @ along[of] / total - of.sum() / independent)

    which, moves = np.arange(2 * FUNCTIONS) % FUNCTIONS, np.diag(A) > 0
    of_size, of_sign = moves & (which < OF_SIZE), moves & (which >= OF_SIZE) & (which < FUNCTIONS - len(PLAYS))
    by_size = share(of_size)
    explained = max(by_size, share(of_sign), share(of_size | of_sign), share(moves))
    if explained < MUCH or explained * total < LEFT_SEEN**2 * size:
        return []
    by = "size" if by_size > 0.5 * explained else "direction"
    return [finding("residuals-follow-input", "nonlinear", (), share_pct=100 * explained, by=by)]


def change_findings(solved: Solved, logs: Sequence[RecordedLog]) -> list[Finding]:
    """Said where what a model leaves follows how the input has just changed: what delays the output is no dead time."""
    plant, theta_s, size, independent = plant_found(solved), solved.dead_time_s, 0.0, 0.0
    tau_s, sums = float(np.mean(plant.time_constants(max(plant.u_range))[0])), np.zeros((4, 4))
    both = list(zip(solved.outputs, solved.missed, strict=True))
    if sum(r @ r for _, r in both) < CHANGES_SEEN**2 * sum(len(y) * np.var(y) for y, _ in both):
        return []
    for log, r in itertools.starmap(thin_out, zip(logs, solved.missed, strict=False)):
        known, dt_s, u = np.isfinite(log.output), log.usual_s, acting_input(log, theta_s)
        lags = [(u, tau_s * part) for part in QUICKER] + [(log.input, theta_s)]
        late = [lagged(one[:, None], dt_s, max(tau, 1e-3 * dt_s))[known, 0] - one[known] for one, tau in lags]
        columns = np.column_stack([*late, r])
        columns -= columns.mean(axis=0)
        sums += columns.T @ columns
        size += float(np.var(log.output[known])) * len(r)
        independent += effective_samples(r, dt_s)
    along, total = sums[:-1, -1], max(float(sums[-1, -1]), 1e-300)
    explained = float(along @ scaled_inverse(sums[:-1, :-1], 1e-10) @ along) / total - 3 / max(independent, 1.0)
    if explained < MUCH or explained * total < CHANGES_SEEN**2 * size:
        return []
    return [finding("residuals-follow-input", "nonlinear", (), share_pct=100 * explained, by="changes")]


def column_findings(solved: Solved, logs: Sequence[RecordedLog]) -> list[Finding]:
    """Said where what a model leaves follows a column that was not read, raw or behind the plant's fast lag; such
    columns are read only where something is left."""
    plant, found = plant_found(solved), dict[str, list[tuple[float, float, float]]]()
    tau_s = float(np.mean(plant.time_constants(max(plant.u_range))[0]))
    for log, y, r in zip(logs, solved.outputs, solved.missed, strict=False):
        known, dt_s = np.isfinite(log.output), log.usual_s
        chance = 2 / effective_samples(r, dt_s)
        left, size = r - r.mean(), float(np.sum((y - y.mean()) ** 2))
        for label, values in log.others() if left @ left > LEFT_SEEN**2 * size else ():
            design = np.hstack([values[:, None], lagged(values[:, None], dt_s, max(tau_s, 1e-3 * dt_s))])[known]
            design = design - design.mean(axis=0)
            explained = left @ design @ np.linalg.lstsq(design, left, rcond=1e-10)[0] - chance * (left @ left)
            found.setdefault(label, []).append((float(explained), float(left @ left), size))
    told = []
    for label, rows in found.items():
        explained, total, size = np.sum(rows, axis=0).tolist()
        if explained > max(MUCH * total, LEFT_SEEN**2 * size):
            told.append((explained / total, label))
    if not told:
        return []
    share, label = max(told)
    return [finding("residuals-follow-column", "nonlinear", (), share_pct=100 * share, column=label)]


def drift_findings(solved: Solved, logs: Sequence[RecordedLog]) -> list[Finding]:
    """Said where a drift explains the output as well as the input does."""
    if not any(map(np.any, solved.missed)):
        return []
    plant, found = plant_found(solved), 0.0
    tau_s = plant.slowest_s(max(plant.u_range))
    for part in WINDOWS:
        along = square = total = 0.0
        count = 0
        for log, y, r in zip(logs, solved.outputs, solved.missed, strict=False):
            rows = max(1, len(y) // MOST_MEANS, min(round(part * tau_s / log.usual_s), len(y) // FEWEST_MEANS))
            means = np.stack([means_of(y, rows), means_of(y + r, rows)], axis=1)
            means -= means.mean(axis=0)
            one, model = unforeseen(means, autoregression(means[:, 0]))[ORDER:].T
            along, square = along + float(one @ model), square + float(model @ model)
            total += float(one @ one)
            count += len(one)
        left = max(total - along**2 / max(square, 1e-300), 1e-300)
        found = max(found, float(along / np.sqrt(max(square, 1e-300) * left / max(count, 1))))
    return [] if found > CLEAR_SD else [finding("drift-explains-as-much", "nonlinear", errors=found)]


def thin_out(log: RecordedLog, left: Array) -> tuple[RecordedLog, Array]:
    """A log of many rows, and what a model leaves of it, in means of some; those of outputs that are not known are
    dropped."""
    rows = len(log.input) // MOST_COUNTED_ROWS
    if rows <= 1:
        return log, left
    known, whole = np.isfinite(log.output), np.zeros(len(log.input))
    whole[known] = left
    share = means_of(known.astype(np.float64), rows)
    part = np.where(share > 0, share, np.nan)
    output, left = means_of(np.where(known, log.output, 0.0), rows) / part, (means_of(whole, rows) / part)[share > 0]
    t = log.time_s[: len(share) * rows : rows]
    return replace(log, time_s=t, input=means_of(log.input, rows), output=output), left


def acting_input(log: RecordedLog, theta_s: float) -> Array:
    """The input of a log behind a dead time, (n,)."""
    at = np.searchsorted(log.time_s, log.time_s - theta_s, side="right") - 1
    return log.input[np.clip(at, 0, len(log.time_s) - 1)]


def functions_of(log: RecordedLog, theta_s: float, tau_s: float, dt_s: float) -> Iterator[Array]:
    """The functions of the input of a log as it acts, raw, then behind a lag, 2 FUNCTIONS of (n,)."""
    u = acting_input(log, theta_s)
    change = np.sign(np.diff(u, prepend=u[0]))
    last = np.maximum.accumulate(np.where(change != 0, np.arange(len(u)), 0))
    moved = change[last]
    for behind in (False, True):
        plays = (follow_play(u, width * float(np.ptp(u))) for width in PLAYS)
        for raw in itertools.chain((u, u * np.abs(u), u**3, moved, moved * np.abs(u)), plays):
            yield lagged(raw[:, None], dt_s, max(tau_s, 1e-3 * dt_s))[:, 0] if behind else raw
