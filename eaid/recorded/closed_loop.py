"""Logs of closed loops: which law drove them, how they track, and a fit that the noise in their duty does not bias.

The recorded duty answers the noise and is no free input. With the law that is found the loop is replayed on the fitted
model without noise; the derivatives Z along the duty that it would have had are instruments, and the fit is where
Σ Z'r is 0.

The law: Δu_k = K_P Δe_k + K_I dt e_(k−1) by least squares over the rows off the limits: exact for a PI that does not
wind up.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import null_space

from eaid.arrays import Array, median
from eaid.control.pi import PIGains
from eaid.estimate.recorded_log import RecordedLog
from eaid.findings import Finding, finding
from eaid.levels.creep import share_is_told
from eaid.options import RigExtras
from eaid.plant.drive import Drive
from eaid.plant.dynamics import plant_numbers
from eaid.recorded.clutch_form import free_share
from eaid.recorded.from_logs import Solved, idle_found, plant_found, with_dead_time
from eaid.recorded.late import follows_output
from eaid.recorded.log_intervals import spread
from eaid.replay.controllers import feedback
from eaid.replay.loop import replay
from eaid.results.recorded import Loop

LAW_PCT = 80.0  # A law that explains less of the duty's changes is none
LEAST_LAW_ROWS = 50  # Rows off the limits that a law is told by


def law_behind(log: RecordedLog) -> tuple[PIGains, float] | None:
    """The PI law behind a log with a reference, and what it explains of its duty [%]; None where that is little."""
    if log.reference is None:
        return None
    u, e = log.input, log.reference - log.output
    off = (u > 0) & (u < float(u.max()) * (1 - 1e-9))
    off &= np.isfinite(e)
    rows = np.flatnonzero(off[1:] & off[:-1]) + 1
    if len(rows) < LEAST_LAW_ROWS:
        return None
    design = np.column_stack([e[rows] - e[rows - 1], log.dt_s[rows - 1] * e[rows - 1]])
    wanted = u[rows] - u[rows - 1]
    K_P, K_I = gains = np.linalg.lstsq(design, wanted, rcond=None)[0]
    size = float(np.linalg.norm(wanted))
    fit_pct = 100 * (1 - float(np.linalg.norm(wanted - design @ gains)) / size) if size > 0 else 0.0
    if not (fit_pct >= LAW_PCT and K_P > 0 and K_I > 0):
        return None
    return PIGains(float(K_P), float(K_I), 0.0, float(u.max())), fit_pct


def simulate_loop(solved: Solved, index: int, log: RecordedLog, law: PIGains) -> RecordedLog:
    """The log that the loop of a law gives on the fitted model, without noise."""
    assert log.reference is not None
    dt_s = float(log.time_s[-1] - log.time_s[0]) / (len(log.input) - 1)
    idle, before = idle_found(solved, index) + (log.baseline or 0.0), np.zeros(int(np.argmax(log.input > 0)))
    wanted = log.reference[len(before) :] - idle  # the law acts on its distance from what is read
    loop = replay(plant_numbers(plant_found(solved)), feedback(law), wanted, RigExtras(), dt_s)
    duty, torque = (np.append(before, loop[name]) for name in ("duty_pct", "torque_nm"))
    return replace(log, input=duty, output=torque + idle, idle_start=log.starts_idle)


def judge_loops(base: Solved, logs: Sequence[RecordedLog]) -> tuple[tuple[Loop, ...], list[Finding]]:
    """Every log of a closed loop, and what is to be said of it."""
    loops: list[Loop] = []
    findings: list[Finding] = []
    by_instrument = base.instruments is not None
    for k, log in enumerate(logs):
        law = law_behind(log)
        if log.reference is None:
            if not (follows := follows_output(base, k, log)):
                continue
            findings.append(finding("duty-follows-output", log.name, correlation=follows))
        known = "loop-instrument" if by_instrument else "loop-direct"
        findings.append(finding(known if law else "loop-bias-unknown", log.name))
        off = None if log.reference is None else (log.reference - log.output)[int(np.argmax(log.input > 0)) :]
        found = {} if law is None else {"K_P": law[0].K_P, "K_I": law[0].K_I, "law_fit_pct": law[1]}
        loops.append(
            Loop(
                log.name,
                saturated_fraction=log.saturated,
                rms_error=None if off is None else float(np.sqrt(np.nanmean(off**2))),
                method="instrument" if law and by_instrument else "direct",
                **found,
            )
        )
    return tuple(loops), findings


INSTRUMENT_STEPS = 20
DAMPED = (1.0, 0.5, 0.2, 0.05)  # Parts of a step that are tried
LOST = 1e-10  # Part of the largest direction's say below which one has none
INSTRUMENTS_TRIED = 2  # Instruments one after another
SHOWN = 1.5  # Half-widths of its interval that a dead time has to be long


def refit_by_instruments(base: Solved, logs: Sequence[RecordedLog]) -> Solved:
    """The fit by instruments, begun at the direct one, behind a dead time where they show one; the direct one where no
    law is known or it does not settle."""
    laws = [law and law[0] for law in map(law_behind, logs)]
    found = _by_instruments(base, logs, laws) if any(laws) else None
    if found is None or base.fitted.dead_time_s or "dead" in base.fitted.extras:
        return found or base
    at, dt_s = base.fitted.shared, median([log.usual_s for log in logs])
    setup, x = with_dead_time(base.fitted, found.x, dt_s)
    late = _by_instruments(replace(found, fitted=setup, x=x), logs, laws)
    if late is None or late.x[at] < SHOWN * spread(late).of(np.eye(len(late.x))[at]):
        return found
    return late


def free_share_by_instruments(found: Solved, logs: Sequence[RecordedLog]) -> tuple[Solved, float] | None:
    """A fit by instruments with C as an unknown, begun at the direct one, and the half-width of C, where they reject
    the one that was held and tell another; None where they do not."""
    held = found.fitted.model
    if found.instruments is None or held.kind != "parallel" or held.share is None:
        return None
    laws = [law and law[0] for law in map(law_behind, logs)]
    free = _by_instruments(free_share(replace(found, instruments=None), held.share), logs, laws)
    if free is None:
        return None
    half = spread(free).of(np.eye(len(free.x))[held.size])
    C = float(free.x[held.size])
    return (free, half) if abs(C - held.share) > half and share_is_told(C - half, C + half) else None


def _by_instruments(base: Solved, logs: Sequence[RecordedLog], laws: Sequence[PIGains | None]) -> Solved | None:
    """The fit by instruments, begun at another; None where it does not settle within the constraints."""
    x, drives = base.x.copy(), list(base.setup.drives)
    for _ in range(INSTRUMENTS_TRIED):  # any duty without noise serves; the second is that of a better model
        now = replace(base, x=x)
        for k, (log, law) in enumerate(zip(logs, laws, strict=True)):
            if law is not None:
                drives[k] = simulate_loop(now, k, log, law).drive
        settled = _solve_instruments(base, x, tuple(drives))
        if settled is None:
            return None
        x = settled
    problem = base.setup.problem()
    if (problem.A @ x - problem.b < -1e-9).any():
        return None
    return replace(base, x=x, instruments=tuple(drives))


def _solve_instruments(base: Solved, x: Array, drives: tuple[Drive, ...]) -> Array | None:
    """Where Σ Z' r is 0 in the directions that no constraint holds, by damped Newton steps from x; None where they do
    not settle."""
    clean = replace(base.setup, drives=drives)
    slopes = [clean.jacobian(x, k)[0] for k in range(len(drives))]
    free = null_space(base.setup.problem().A[base.active]) if len(base.active) else np.eye(len(x))

    def scores(x: Array) -> tuple[Array, Array]:
        A, score = np.zeros((len(x), len(x))), np.zeros(len(x))
        for k, Z in enumerate(slopes):
            J, r = base.setup.jacobian(x, k)
            at = base.setup.places[k].columns
            A[np.ix_(at, at)] += Z.T @ J
            score[at] += Z.T @ r
        return free.T @ A @ free, free.T @ score

    A, score = scores(x)
    scale = np.sqrt(np.maximum(np.abs(np.diagonal(A)), 1e-300))
    for _ in range(INSTRUMENT_STEPS):
        move = -np.linalg.lstsq(A / np.outer(scale, scale), score / scale, rcond=LOST)[0]
        if float(np.abs(move).max()) < 1e-7 * np.sqrt(base.cost):
            return x
        for length in DAMPED:
            further = x + free @ (length * move / scale)
            A, after = scores(further)
            if np.linalg.norm(after / scale) < np.linalg.norm(score / scale):
                break
        else:
            return None
        x, score = further, after
    return None
