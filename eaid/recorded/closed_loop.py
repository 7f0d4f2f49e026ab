"""Logs of closed loops: which law drove them, how they track, and a fit that the noise in their duty does not bias.

With the law that is found the loop is replayed on the fitted model without noise: for what it should have tracked, and
for the duty that it would have had. The recorded duty answers the noise and is no free input; the derivatives Z along
the other one are instruments, and the fit is where Σ Z'r is 0.

The law: Δu_k = K_P Δe_k + K_I dt e_(k−1) by least squares over the rows off the limits: exact for a PI that does not
wind up.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eaid.arrays import Array
from eaid.control.margins import Point, Timing, known, lags_at, loop_margins
from eaid.control.pi import PIGains
from eaid.estimate.from_logs import Solved, idle_of, model_of
from eaid.estimate.late import follows_output
from eaid.estimate.record import RecordedLog
from eaid.estimate.response import Copies, Drive
from eaid.findings import Finding, finding
from eaid.models.nonlinear import steady_torque
from eaid.models.parameters import Nonlinear
from eaid.options import Rig
from eaid.replay.controllers import Controller, pi_controller
from eaid.replay.loop import Inputs, loop_of, reference_rate, rig_numbers
from eaid.replay.plant import plant_parameters
from eaid.results.recorded import Loop

LAW_PCT = 80.0
"""A law that explains less of the duty's changes is none."""


@dataclass(frozen=True, eq=False)
class Law:
    """A PI that explains a recorded duty."""

    gains: PIGains
    fit_pct: float
    first: int
    """Row at which the loop was closed."""


def run_loop(
    model: Nonlinear, controller: Controller, reference: Array, dt_s: float, share: Array, added: Array
) -> tuple[Array, Array]:
    """Duty [%] and read torque [N·m] of a loop, from rest, whose reading is T (1 + share) + added; shapes (n,)."""
    n = len(reference)
    columns = [[0.0] * n for _ in range(6)]
    rate = reference_rate(reference, dt_s, controller.looks_ahead)
    inputs = Inputs(*(column.tolist() for column in (reference, rate, added, 1.0 + share)))
    numbers = rig_numbers(Rig(), dt_s)
    loop_of(controller.step)(
        controller.gains, controller.start, plant_parameters(model), numbers, dt_s, inputs, columns
    )
    return np.array(columns[2]), np.array(columns[1])


def law_of(log: RecordedLog) -> Law | None:
    """The PI law behind a log with a reference; None where none explains its duty."""
    law = nearest_law(log)
    explains = law is not None and law.fit_pct >= LAW_PCT and law.gains.K_P > 0 and law.gains.K_I > 0
    return law if explains else None


def nearest_law(log: RecordedLog) -> Law | None:
    """The PI that comes nearest to a log's duty; None without a reference or with too few rows off the limits."""
    if log.reference is None:
        return None
    u, e = log.input, log.reference - log.output
    acting = np.flatnonzero(u > 0)
    if len(acting) < 50:
        return None
    top = float(u.max())
    off = (u > 0) & (u < top * (1 - 1e-9))
    rows = np.flatnonzero(off[1:] & off[:-1]) + 1
    if len(rows) < 50:
        return None
    design = np.column_stack([e[rows] - e[rows - 1], log.dt_s[rows - 1] * e[rows - 1]])
    wanted = u[rows] - u[rows - 1]
    gains = np.linalg.lstsq(design, wanted, rcond=None)[0]
    size = float(np.linalg.norm(wanted))
    fit_pct = 100 * (1 - float(np.linalg.norm(wanted - design @ gains)) / size) if size > 0 else 0.0
    return Law(PIGains(float(gains[0]), float(gains[1]), 0.0, top), fit_pct, int(acting[0]))


def simulated(solved: Solved, index: int, log: RecordedLog, law: Law) -> RecordedLog:
    """The log that the loop of a law gives on the fitted model, without noise."""
    assert log.reference is not None
    n = len(log.input)
    dt_s = float(log.time_s[-1] - log.time_s[0]) / (n - 1)
    added = np.full(n, idle_of(solved, index) + (log.baseline or 0.0))
    duty, measured = np.zeros(n), added.copy()
    controller = pi_controller(law.gains)
    part = slice(law.first, n)
    duty[part], measured[part] = run_loop(
        model_of(solved), controller, np.asarray(log.reference[part]), dt_s, np.zeros(n - law.first), added[part]
    )
    return replace(log, input=duty, output=measured, idle_start=log.starts_idle)


OTHERWISE = 1.5
"""A loop that misses its reference by so many times what is predicted has something that is not in the model."""


def judged_loops(base: Solved, logs: Sequence[RecordedLog]) -> tuple[tuple[Loop, ...], list[Finding]]:
    """Every log of a closed loop, and what is to be said of it."""
    loops: list[Loop] = []
    findings: list[Finding] = []
    laws = [law_of(log) for log in logs]
    for k, (log, law) in enumerate(zip(logs, laws, strict=True)):
        if log.reference is None:
            follows = follows_output(base, k, log)
            if follows:
                findings.append(finding("duty-follows-output", log.name, correlation=follows))
                findings.append(finding("loop-bias-unknown", log.name))
                loops.append(Loop(log.name, saturated_fraction=log.saturated))
            continue
        if law is None:
            findings += [_of_another_law(log), finding("loop-bias-unknown", log.name)]
        elif base.instruments is not None:
            findings.append(finding("loop-instrument", log.name))
        else:
            findings.append(finding("loop-bias-unknown", log.name))
        loops.append(_loop(base, k, log, law))
        rms, predicted = loops[-1].rms_error, loops[-1].predicted_rms_error
        if rms is not None and predicted is not None:
            noise = float(np.std(base.missed[k]))
            if rms > OTHERWISE * float(np.hypot(predicted, noise)):
                findings.append(finding("loop-tracks-otherwise", log.name, rms=rms, predicted=predicted))
    return tuple(loops), findings


def _of_another_law(log: RecordedLog) -> Finding:
    """What is seen of a loop that no PI explains: how it tracks, and how long it stands at its limit."""
    assert log.reference is not None
    law = nearest_law(log)
    acting = log.input > 0
    error = (log.reference - log.output)[acting]
    return finding(
        "loop-law-unknown", log.name,
        fit_pct=None if law is None else law.fit_pct,
        rms=float(np.sqrt(np.nanmean(error**2))),
        largest=float(log.reference[acting].max()),
        saturated_pct=100 * log.saturated,
    )  # fmt: skip


def _loop(base: Solved, index: int, log: RecordedLog, law: Law | None) -> Loop:
    assert log.reference is not None
    acting = slice(int(np.flatnonzero(log.input > 0)[0]), None)
    error = (log.reference - log.output)[acting]
    plain = Loop(log.name, saturated_fraction=log.saturated, rms_error=float(np.sqrt(np.mean(error**2))))
    if law is None:
        return plain
    replayed = simulated(base, index, log, law)
    off = (log.reference - replayed.output)[acting]
    gain, phase = least_margins(model_of(base), law.gains, log)
    return Loop(
        log.name,
        K_P=law.gains.K_P,
        K_I=law.gains.K_I,
        law_fit_pct=law.fit_pct,
        saturated_fraction=plain.saturated_fraction,
        rms_error=plain.rms_error,
        predicted_rms_error=float(np.sqrt(np.mean(off**2))),
        rms_from_predicted=float(np.sqrt(np.mean((log.output - replayed.output)[acting] ** 2))),
        gain_margin_db=gain,
        phase_margin_deg=phase,
        method="direct" if base.instruments is None else "instrument",
    )


def least_margins(model: Nonlinear, gains: PIGains, log: RecordedLog) -> tuple[float | None, float | None]:
    """Least gain margin [dB] and phase margin [°] over the inputs that a loop used, at its sample time."""
    used = log.input[(log.input > 0) & (log.input < log.input.max())]
    low, high = np.clip(np.quantile(used, [0.05, 0.95]), *model.u_range)
    timing = Timing(1 / float(np.median(np.diff(log.time_s))), None)
    points = [Point(u, float(steady_torque(model, u)), lags_at(model, u)) for u in np.linspace(low, high, 9).tolist()]
    margins = list(loop_margins(gains, points, timing))
    return known(min(one.gain_db for one in margins)), known(min(one.phase_deg for one in margins))


ROUNDS = 20
RENEWED = 2
"""Instruments one after another."""


def with_instrument(base: Solved, logs: Sequence[RecordedLog]) -> Solved:
    """The fit by instruments, begun at the direct one; the direct one where no law is known or it does not settle."""
    laws = [law_of(log) for log in logs]
    if not any(law is not None and log.starts_idle for law, log in zip(laws, logs, strict=True)):
        return base
    x, drives = base.x.copy(), list(base.setup.drives)
    for _ in range(RENEWED):  # any duty without noise serves; the second is that of a better model
        now = replace(base, x=x)
        for k, (log, law) in enumerate(zip(logs, laws, strict=True)):
            if law is not None and log.starts_idle:
                drives[k] = Copies(simulated(now, k, log, law)).every
        settled = _solved(base, x, tuple(drives))
        if settled is None:
            return base
        x = settled
    problem = base.setup.problem()
    if (problem.A @ x - problem.b < -1e-9).any():
        return base
    return replace(base, x=x, instruments=tuple(drives))


def _solved(base: Solved, x: Array, drives: tuple[Drive, ...]) -> Array | None:
    """Where Σ Z' r is 0, by Newton's steps from x; None where they do not settle."""
    clean = replace(base.setup, drives=drives)
    slopes = [clean.jacobian(x, k)[0] for k in range(len(drives))]
    for _ in range(ROUNDS):
        A, score = np.zeros((len(x), len(x))), np.zeros(len(x))
        for k in range(len(drives)):
            J, r = base.setup.jacobian(x, k)
            Z, at = slopes[k], base.setup.places[k].columns
            A[np.ix_(at, at)] += Z.T @ J
            score[at] += Z.T @ r
        scale = np.sqrt(np.maximum(np.abs(np.diagonal(A)), 1e-300))
        move = -np.linalg.solve(A / np.outer(scale, scale), score / scale) / scale
        x = x + move
        if float(np.abs(move * scale).max()) < 1e-7 * np.sqrt(base.cost):
            return x
    return None
