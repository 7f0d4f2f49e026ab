"""Logs of closed loops: which law drove them, how they track, and what the noise in their duty does to a direct fit.

A PI law Δu_k = K_P Δe_k + K_I dt e_(k−1) is found by least squares over the rows off the limits. With it the loop is
replayed on the fitted model: without noise for what it should have tracked; with noise like the residuals', and
refitted, for the bias of the direct fit, since the duty answers the noise and is no free input. The instrument takes
that bias out:

    Σ Z_k' r_k(θ) = 0,   Z the derivatives along the duty that the loop has without noise, r along the recorded one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eaid.arrays import Array
from eaid.control.pi import PIGains, pi_start, pi_step
from eaid.findings import Finding, finding
from eaid.models.parameters import Nonlinear
from eaid.recorded.drive import Drive, drive_of
from eaid.recorded.intervals import inputs_shown
from eaid.recorded.log import RecordedLog
from eaid.recorded.options import RecordedOptions
from eaid.recorded.solve import Solved, refit
from eaid.replay.controllers import Controller
from eaid.replay.loop import loop_of, reference_rate
from eaid.replay.plant import plant_parameters
from eaid.replay.rig import Rig, rig_numbers
from eaid.results.recorded import Bias, Loop

LAW_PCT = 80.0
"""A law that explains less of the duty's changes is none."""
FOLLOWS = 0.1
"""Correlation of the duty's changes with the residual's from which a log counts as a loop."""
OTHERWISE = 1.5
"""A loop that misses its reference by so many times what is predicted has something that is not in the model."""
ROUNDS = 20
RENEWED = 2
"""Instruments one after another."""


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
    loop_of(controller.step)(
        controller.gains, controller.start, plant_parameters(model), rig_numbers(Rig(), dt_s), dt_s,
        reference.tolist(), reference_rate(reference, dt_s, controller.looks_ahead).tolist(),
        added.tolist(), (1.0 + share).tolist(), *columns,
    )  # fmt: skip
    return np.array(columns[2]), np.array(columns[1])


def law_of(log: RecordedLog) -> Law | None:
    """The PI law behind a log with a reference; None where none explains its duty."""
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
    found = np.linalg.lstsq(design, wanted, rcond=None)[0]
    size = float(np.linalg.norm(wanted))
    fit_pct = 100 * (1 - float(np.linalg.norm(wanted - design @ found)) / size) if size > 0 else 0.0
    if fit_pct < LAW_PCT or found[0] <= 0 or found[1] <= 0:
        return None
    return Law(PIGains(float(found[0]), float(found[1]), 0.0, top), fit_pct, int(acting[0]))


def model_of(solved: Solved) -> Nonlinear:
    """The fitted model, with its release where that was fitted."""
    setup = solved.setup
    assert setup.model.basis is not None
    parameters = setup.model.basis.parameters(solved.coefficients)
    at = setup.at("rest")
    return parameters if at < 0 else replace(parameters, release=(float(solved.x[at]), float(solved.x[at + 1])))


def idle_of(solved: Solved, log: int) -> float:
    """Idle output of a log, fitted or known to be 0 after its baseline."""
    at = int(solved.setup.own[log][0])
    return float(solved.x[at]) if at >= 0 else 0.0


def simulated(solved: Solved, index: int, log: RecordedLog, law: Law, noise: Array | None) -> RecordedLog:
    """The log that the loop of a law gives on the fitted model, `noise` added to what is read, (n,)."""
    assert log.reference is not None
    n = len(log.input)
    dt_s = float(log.time_s[-1] - log.time_s[0]) / (n - 1)
    added = np.full(n, idle_of(solved, index) + (log.baseline or 0.0)) + (0.0 if noise is None else noise)
    duty, seen = np.zeros(n), added.copy()
    controller = Controller("pi", pi_step, law.gains, pi_start())
    part = slice(law.first, n)
    duty[part], seen[part] = run_loop(
        model_of(solved), controller, np.asarray(log.reference[part]), dt_s, np.zeros(n - law.first), added[part]
    )
    return replace(log, input=duty, output=seen, idle_start=log.starts_idle)


def like_residuals(r: Array, draw: np.random.Generator) -> Array:
    """Noise of the residuals' own spectrum, with phases of its own, (n,)."""
    spectrum = np.fft.rfft(r)
    turned = np.abs(spectrum) * np.exp(2j * np.pi * draw.uniform(size=len(spectrum)))
    return np.asarray(np.fft.irfft(turned, len(r)))


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
                drives[k] = drive_of(simulated(now, k, log, law, None))
        found = _solved(base, x, tuple(drives))
        if found is None:
            return base
        x = found
    problem = base.setup.problem()
    if (problem.A @ x - problem.b < -1e-9).any():
        return base
    return replace(base, x=x, cost=problem.value(x)[0], instruments=tuple(drives))


def _solved(base: Solved, x: Array, drives: tuple[Drive, ...]) -> Array | None:
    """Where Σ Z' r is 0, by Newton's steps from x; None where they do not settle."""
    clean = replace(base.setup, drives=drives)
    slopes = [clean.jacobian(x, k)[0] for k in range(len(drives))]
    for _ in range(ROUNDS):
        A, score = np.zeros((len(x), len(x))), np.zeros(len(x))
        for k in range(len(drives)):
            J, r = base.setup.jacobian(x, k)
            Z, at = slopes[k], base.setup.columns(k)
            A[np.ix_(at, at)] += Z.T @ J
            score[at] += Z.T @ r
        scale = np.sqrt(np.maximum(np.abs(np.diagonal(A)), 1e-300))
        move = -np.linalg.solve(A / np.outer(scale, scale), score / scale) / scale
        x = x + move
        if float(np.abs(move * scale).max()) < 1e-7 * np.sqrt(base.cost):
            return x
    return None


def judged_loops(
    base: Solved, logs: Sequence[RecordedLog], options: RecordedOptions
) -> tuple[tuple[Loop, ...], list[Finding]]:
    """Every log of a closed loop, and what is to be said of it."""
    loops: list[Loop] = []
    found: list[Finding] = []
    laws = [law_of(log) for log in logs]
    bias = None
    if base.instruments is None and options.loop_refits > 0 and any(law is not None for law in laws):
        bias = bias_of(base, logs, laws, options.loop_refits, options.seed)
        found.append(_bias_finding(bias))
    for k, (log, law) in enumerate(zip(logs, laws, strict=True)):
        if log.reference is None:
            follows = 0.0 if log.stepwise else answers(base, k, log)
            if abs(follows) > FOLLOWS:
                found.append(finding("duty-follows-output", log.name, correlation=follows))
                found.append(finding("loop-bias-unknown", log.name))
                loops.append(Loop(log.name, saturated_fraction=saturated(log)))
            continue
        if law is None:
            found.append(finding("loop-bias-unknown", log.name))
        elif base.instruments is not None:
            found.append(finding("loop-instrument", log.name))
        loops.append(_loop(base, k, log, law, bias))
        rms, predicted = loops[-1].rms_error, loops[-1].predicted_rms_error
        if rms is not None and predicted is not None:
            noise = float(np.std(base.setup.jacobian(base.x, k)[1]))
            if rms > OTHERWISE * float(np.hypot(predicted, noise)):
                found.append(finding("loop-tracks-otherwise", log.name, rms=rms, predicted=predicted))
    return tuple(loops), found


def saturated(log: RecordedLog) -> float:
    """Part of the acting time that the duty stands at its largest value."""
    top = float(log.input.max())
    acting = float(log.dt_s[log.input > 0].sum())
    at_top = float(log.dt_s[log.input >= top * (1 - 1e-9)].sum())
    return at_top / acting if acting > 0 and at_top > 2 * float(np.median(log.dt_s)) else 0.0


def answers(base: Solved, index: int, log: RecordedLog) -> float:
    """Correlation of the duty's changes with the residual's: a free input knows nothing of the noise."""
    r = base.setup.jacobian(base.x, index)[1]
    if len(r) != len(log.input):
        return 0.0
    off = (log.input > 0) & (log.input < log.input.max())
    rows = np.flatnonzero(off[1:] & off[:-1]) + 1
    if len(rows) < 100:
        return 0.0
    du, dr = log.input[rows] - log.input[rows - 1], r[rows - 1] - r[rows]
    size = float(np.linalg.norm(du) * np.linalg.norm(dr))
    return float(du @ dr) / size if size > 0 else 0.0


def _loop(base: Solved, index: int, log: RecordedLog, law: Law | None, bias: Bias | None) -> Loop:
    assert log.reference is not None
    acting = slice(int(np.flatnonzero(log.input > 0)[0]), None)
    error = (log.reference - log.output)[acting]
    plain = Loop(log.name, saturated_fraction=saturated(log), rms_error=float(np.sqrt(np.mean(error**2))))
    if law is None:
        return plain
    replayed = simulated(base, index, log, law, None)
    off = (log.reference - replayed.output)[acting]
    gain, phase = margins(model_of(base), law.gains, log)
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
        bias=bias,
    )


def margins(model: Nonlinear, gains: PIGains, log: RecordedLog) -> tuple[float | None, float | None]:
    """Least gain margin [dB] and phase margin [°] over the inputs that a loop used; half a sample of delay.

    G(s) = T_s'(u) (C/(1 + τ1 s) + (1 − C)/(1 + τ2 s)) about each input.
    """
    from eaid.models.nonlinear import steady_torque, time_constants

    used = log.input[(log.input > 0) & (log.input < log.input.max())]
    low, high = np.clip(np.quantile(used, [0.05, 0.95]), *model.u_range)
    dt_s = float(np.median(np.diff(log.time_s)))
    w = np.geomspace(1e-3, np.pi / dt_s, 4000)
    s = 1j * w
    least_gain, least_phase = np.inf, np.inf
    for u in np.linspace(low, high, 9):
        tau1, tau2 = (float(one) for one in time_constants(model, u))
        slope = float(steady_torque(model, u + 0.5) - steady_torque(model, u - 0.5))
        L = slope * (model.C / (1 + tau1 * s) + (1 - model.C) / (1 + tau2 * s))
        L = L * (gains.K_P + gains.K_I / s) * np.exp(-0.5 * dt_s * s)
        size, angle = np.abs(L), np.unwrap(np.angle(L))
        crossed = np.flatnonzero((size[:-1] >= 1) & (size[1:] < 1))
        if len(crossed):
            least_phase = min(least_phase, 180 + float(np.degrees(angle[crossed]).min()))
        turned = np.flatnonzero((angle[:-1] > -np.pi) & (angle[1:] <= -np.pi))
        if len(turned):
            least_gain = min(least_gain, float(-20 * np.log10(size[turned]).max()))
    return (
        least_gain if np.isfinite(least_gain) else None,
        least_phase if np.isfinite(least_phase) else None,
    )


def bias_of(base: Solved, logs: Sequence[RecordedLog], laws: Sequence[Law | None], refits: int, seed: int) -> Bias:
    """Refits on simulated logs of the same loops: their mean error and their scatter."""
    draw = np.random.default_rng(seed)
    model = base.setup.model
    used = np.concatenate([log.input[log.input > 0] for log in logs])
    low, high = np.clip(np.quantile(used, [0.1, 0.9]), model.low, model.high).tolist()
    shown = inputs_shown((), low, high)
    truth = _logs_of_curves(base, shown)
    rows = []
    left = [base.setup.jacobian(base.x, k)[1] for k in range(len(base.setup.drives))]
    for _ in range(refits):
        drives: list[Drive] = []
        for k, drive in enumerate(base.setup.drives):
            noise = like_residuals(left[k], draw)
            law = laws[k] if k < len(laws) else None
            if law is not None and logs[k].starts_idle and len(noise) == len(logs[k].input):
                drives.append(drive_of(simulated(base, k, logs[k], law, noise)))
                continue
            again = drive.y.copy()
            counted = drive.w > 0
            again[counted] += (left[k] + noise) / np.sqrt(drive.w[counted])
            drives.append(replace(drive, y=again))
        rows.append(_logs_of_curves(refit(base, drives), shown) - truth)
    errors = np.array(rows)
    mean, sd = errors.mean(axis=0), errors.std(axis=0, ddof=1) if refits > 1 else np.zeros_like(errors[0])
    off = [100 * float(np.sqrt(np.mean(one**2))) for one in mean]
    wide = [100 * float(np.sqrt(np.mean(one**2))) for one in sd]
    return Bias(refits, off[0], off[1], off[2], wide[0], wide[1], wide[2])


def _logs_of_curves(solved: Solved, duty: Array) -> Array:
    """log T_s, log τ1, log τ2, (3, L)."""
    tables = solved.setup.model.tables(solved.setup.model.rows_of(duty), solved.coefficients)
    return np.asarray(np.log(np.maximum(np.array([tables.steady, tables.tau1, tables.tau2]), 1e-9)))


def _bias_finding(bias: Bias) -> Finding:
    pairs = (
        (bias.Ts_pct, bias.scatter_Ts_pct),
        (bias.tau1_pct, bias.scatter_tau1_pct),
        (bias.tau2_pct, bias.scatter_tau2_pct),
    )
    few = max(bias.refits, 1) ** 0.5
    beyond = any(off is not None and sd is not None and off > max(0.5, 3 * sd / few) for off, sd in pairs)
    return finding(
        "loop-bias" if beyond else "loop-bias-small", "nonlinear",
        refits=bias.refits, Ts_pct=bias.Ts_pct, tau1_pct=bias.tau1_pct, tau2_pct=bias.tau2_pct,
    )  # fmt: skip
