"""`couple`: the stiffest walls of every loop at every torque, and what else limits them (docs/coupling.md).

**Passive.** The clutch's torque follows the limb's sampled angle, T(s) = −W(s) D(e^(sh)) θ*(s): D is the wall and the
closed torque loop at the samples, W = P(s)(1 − e^(−sh))/s the hold and the plant. Seen from the limb's speed v = sθ all
aliases ω_n = ω + 2πn/h of a frequency take part, and b |v|² + Re v*T ≥ 0 for every v asks at each ω for

    b ≥ ½ (√(‖p‖²‖q‖² − (Im p*q)²) − Re p*q),     p_n = 1/(jω_n)*,   q_n = D(e^(jωh)) W(jω_n)/h

(the least eigenvalue of a Hermitian matrix of rank two). With W the plain hold this is Colgate and Schenkel's
b ≥ h/2/(1 − cos ωh) · Re{(1 − e^(−jωh)) D}; for slow loops it is b ≥ K max(−Im G(jω)/ω).

**Stable.** With M the sampled angle per wanted torque, hold, plant, limb and dead time in it, the loop of a wall turns
unstable where 1 + (K + B_v (1 − 1/z)/h) M = 0 on |z| = 1: the least K > 0 of

    K = −Re(1/M + B_v (1 − 1/z)/h)   at the frequencies where the imaginary part is 0, the Nyquist frequency among them.
"""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from eaid.arrays import Array
from eaid.control import margins
from eaid.control.defaults import control_rate, of_this_mounting
from eaid.control.gains import law_of, plant_of, refuse_other_units
from eaid.control.kinds import Law
from eaid.control.margins import LinearLaw, Point, finite
from eaid.errors import DataError, GainsError, UsageError
from eaid.findings import Finding, finding, ranked
from eaid.options import LOOPS, CoupleOptions
from eaid.plant.dynamics import Plant, plant_numbers, plant_rest, plant_step
from eaid.plant.operating import Complex, around
from eaid.progress import Progress
from eaid.replay.controllers import feedback
from eaid.replay.loop import Held, hold_step
from eaid.replay.rehab import limb_steps
from eaid.results import coupling as parts
from eaid.results.fit import Fit
from eaid.results.gains import Gains, Timing

NEVER = math.inf, 0.0
AT_EDGE = 1e-3  # Part of the largest T_s by which a torque may lie beyond those that are held, as digits leave it
STIFFEST = 1e6  # [N·m/rad]; a wall beyond it is called without limit
ALIASES = 12  # Aliases on either side: W falls with 1/ω², so the rest weighs less than 1e-5 of the sum
BESIDE_RAD = 1e-4  # Where the limb is let go
TURNS, MOST_WALL_SAMPLES = 20, 200_000  # Of a replay: swings, and samples beyond which none is made
WALL_PER_LAG = 1000  # Samples in the fastest lag from which a rig is sampled no faster by itself …
PER_LIMB = 20  # … nor in the limb's time J/b


@dataclass(frozen=True, eq=False)
class Channel:
    """A clutch around a held torque, its loop without limits."""

    plant: Plant
    point: Point
    law: LinearLaw
    # step(state, reference, its rate, torque) → (next state, duty)
    step: Callable[[Any, float, float, float], tuple[Any, float]]
    start: Any  # State of the law at rest


def channel_of(loop: str, plant: Plant, torque_nm: float, gains: Law | None, dt_s: float) -> Channel:
    """A loop around a held torque; UsageError where it needs gains that are not given, or for a torque outside the
    identified duties."""
    least, most = (float(plant.steady(u)) for u in plant.u_range)
    if least == most:
        raise UsageError("the fit knows one level only, and a wall needs how T_s rises; record more levels")
    if not least - AT_EDGE * most <= torque_nm <= (1 + AT_EDGE) * most:
        raise UsageError(
            f"«torque» {torque_nm:g}: the fitted plant holds {least:.3g} to {most:.3g} within its identified inputs; "
            "choose a torque in between"
        )
    torque_nm = min(max(torque_nm, least), most)
    held = float(brentq(lambda u: float(plant.steady(u)) - torque_nm, *plant.u_range, xtol=1e-12))
    point = Point(held, torque_nm, around(plant, held))
    if not point.plant.gain > 0:
        raise UsageError(f"«torque» {torque_nm:g}: T_s does not rise with the input there; choose another torque")
    if loop == "open-loop":
        # down to rest, as a wall takes torque off, too; so fine a table is good to 1e-8 of the range
        lowest, highest = -plant.u_range[1] if plant.signed else 0.0, plant.u_range[1]
        duties = np.union1d(np.linspace(lowest, highest, 20_001), plant.u_range)
        steady = plant.steady(duties)
        law = LinearLaw(1 / point.plant.gain, 0.0, 0.0, 0.0)
        return Channel(plant, point, law, lambda s, r, _v, _t: (s, float(np.interp(r, steady, duties))), None)
    if gains is None:
        kind = "a PI" if loop == "pi" else "a robust controller"
        raise UsageError(f"the loop {loop} needs gains with {kind}; give «gains» that tune-rc wrote")
    acting = feedback(gains._replace(duty_min=-math.inf, duty_max=math.inf))
    rate = 0.0 if loop == "rc-no-rate" else 1.0
    law, integral = margins.law_around(gains, torque_nm, point.duty_pct)
    return Channel(
        plant, point, law._replace(k_v=rate * law.k_v),
        lambda s, r, v, t: acting.step(acting.gains, s, r, rate * v, t, dt_s),
        integral,
    )  # fmt: skip


def duty_response(channel: Channel, timing: Timing, omega: Array) -> Complex:
    """Duty per reference at sampled frequencies [rad/s], the torque loop closed, its dead time and the mean response of
    the PWM's latch in it."""
    law, z, late = channel.law, np.exp(1j * omega * timing.step_s), np.exp(-1j * omega * timing.delay_s)
    by_torque = law.response(z, timing.step_s)
    measured = margins.measured_response(channel.point.plant, timing, omega) * late
    by_reference = law.k_r - law.k_T + by_torque + law.k_v * (1 - 1 / z) / timing.step_s
    closed = by_reference / (1 + by_torque * measured)
    return np.asarray(closed * margins.latch_response(timing, omega) * late, dtype=np.complex128)


def stable_stiffness(channel: Channel, timing: Timing, options: CoupleOptions) -> tuple[float, float]:
    """The least K at which the wall with a limb stops being stable [N·m/rad]: infinite beyond `STIFFEST`, 0 where B_v
    alone is too much; and the frequency at which it then swings [rad/s]."""
    h, B_v = timing.step_s, options.virtual_damping
    omega = margins.frequencies(channel.point.plant, timing, 4000)
    z = np.exp(1j * omega * h)
    rate, plant = np.zeros((5, 5)), channel.point.plant  # plant, angle and speed of the limb; the duty held
    rate[:2, :2], rate[:2, 4], rate[3, :2] = plant.A, plant.b, plant.c / options.limb_inertia
    rate[2, 3], rate[3, 3] = 1.0, -options.limb_damping / options.limb_inertia
    flow = expm(rate * h)
    turned = np.linalg.solve(z[:, None, None] * np.eye(4) - flow[:4, :4], flow[:4, 4:])[:, 2, 0]
    stiffness, damper = 1 / (duty_response(channel, timing, omega) * turned), (1 - 1 / z) / h

    def first(curve: Complex) -> tuple[float, float]:
        """The least −Re > 0 of a curve where its imaginary part is 0; without a latch that is so at the last too."""
        real, imag = curve.real, curve.imag
        k = np.flatnonzero((imag[:-1] < 0) != (imag[1:] < 0))  # crossed between, by a straight line
        at = -(real[k] + imag[k] / (imag[k] - imag[k + 1]) * (real[k + 1] - real[k]))
        if timing.pwm_hz is None:
            at, k = np.append(at, -real[-1]), np.append(k, len(omega) - 1)
        return min(((K, w) for K, w in zip(at.tolist(), omega[k].tolist(), strict=True) if K > 0), default=NEVER)

    if B_v > 0 and first(stiffness / damper)[0] <= B_v:
        return 0.0, 0.0
    least = first(stiffness + B_v * damper)
    return least if least[0] < STIFFEST else NEVER


def passive_stiffness(channel: Channel, timing: Timing, options: CoupleOptions) -> float:
    """The stiffest passive wall [N·m/rad] on a limb of a damping b.

    0 where B_v alone is too much, inf where there is no limit below `STIFFEST`. What a wall needs is convex in K (the
    least eigenvalue of a matrix that is linear in K), so it grows beyond b once.
    """
    h, B_v, damping_nms = timing.step_s, options.virtual_damping, options.limb_damping
    # From far below the slowest lag to just below the Nyquist frequency
    omega = np.geomspace(1e-3 / max(1.0, 0.01 * channel.point.plant.slowest_s), 0.999 * np.pi * timing.rate_hz, 1200)
    alias = omega + 2 * np.pi / h * np.arange(-ALIASES, ALIASES + 1)[:, None]
    D = duty_response(channel, timing, omega)  # For K = 1
    q = D * channel.point.plant.response(1j * alias) * margins.hold_response(alias, h)  # D W/h
    # ‖p‖ in closed form: Σ 1/ω_n² = (h/2)²/sin²(ωh/2)
    size = 0.5 * h / np.sin(0.5 * omega * h) * np.linalg.norm(q, axis=0)
    product = np.sum(q / (1j * alias), axis=0)

    def needed(stiffness: float) -> float:
        """Damping that the wall asks of the limb [N·m·s/rad]; per K about max(−Im G(jω)/ω)."""
        wall = stiffness + B_v * (1 - np.exp(-1j * omega * h)) / h
        inner = wall * product
        across = np.sqrt(np.maximum((np.abs(wall) * size) ** 2 - inner.imag**2, inner.real**2))
        return float(0.5 * (across - inner.real).max())

    if needed(STIFFEST) <= damping_nms:
        return math.inf
    if B_v == 0:  # in proportion to K
        return damping_nms / needed(1.0)
    if needed(1e-3) > damping_nms:
        return 0.0
    return float(brentq(lambda K: needed(K) - damping_nms, 1e-3, STIFFEST, rtol=1e-9))


def growth(drive: Channel, options: CoupleOptions, timing: Timing, stiffness: float, time_s: float) -> float:
    """Log of how much the limb's swing, let go at `BESIDE_RAD` with the torque held at T_0, grows from the third to the
    last quarter of the time; below 0 it dies away."""
    h, plant, point = timing.step_s, plant_numbers(drive.plant), drive.point
    held = Held(*plant_rest(plant, point.torque_nm), point.duty_pct, 0)
    state, angle, speed, before = drive.start, BESIDE_RAD, 0.0, point.torque_nm
    waiting = [point.duty_pct] * round(timing.delay_samples)
    period = timing.rate_hz / timing.pwm_hz if timing.pwm_hz else 0.0
    keep, push, drift, lift = limb_steps(options.limb_inertia, options.limb_damping, h)
    angles = []
    for k in range(round(time_s / h)):
        torque = held.x1 + plant.z * held.x2
        wanted = point.torque_nm - stiffness * angle
        state, duty = drive.step(state, wanted, (wanted - before) / h, torque)
        before = wanted
        waiting.append(duty)
        held, _ = hold_step(plant, period, h, k, waiting.pop(0), held)
        moment = 0.5 * (torque + held.x1 + plant.z * held.x2) - point.torque_nm
        angles.append(angle)
        angle, speed = angle + drift * speed + lift * moment, keep * speed + push * moment
        if abs(angle) > 1.0:
            return math.inf
    quarter, speeds = (len(angles) - 1) // 4, np.diff(angles)  # a slow drift of the middle weighs little
    late, last = (max(float(np.std(speeds[i * quarter : (i + 1) * quarter])), 1e-300) for i in (2, 3))
    return math.log(last / late)


def replayed_stiffness(
    drive: Channel, options: CoupleOptions, timing: Timing, expected: float, omega: float
) -> float | None:
    """The stiffness at which the replay neither grows nor dies away [N·m/rad], near what linear theory expects, which
    swings at ω [rad/s]; None where it is not within a factor of two of that, or samples are too many in a swing."""
    slower = min(omega, math.sqrt(expected / options.limb_inertia))
    time_s = max(TURNS * 2 * math.pi / slower, 200 * timing.step_s)
    if time_s > MOST_WALL_SAMPLES * timing.step_s:
        return None

    def rate(log_stiffness: float) -> float:
        return min(growth(drive, options, timing, math.exp(log_stiffness), time_s), 20.0)

    for factor in (1.03, 1.3, 2.0):
        low, high = math.log(expected / factor), math.log(expected * factor)
        below, above = rate(low), rate(high)
        if not below < 0 < above:
            continue
        for _ in range(2 if factor < 1.1 else 8):  # false position: growth is nearly linear in log K so near its edge
            middle = low - below * (high - low) / (above - below)
            at = rate(middle)
            low, below, high, above = (middle, at, high, above) if at < 0 else (low, below, middle, at)
        return math.exp(low - below * (high - low) / (above - below))
    return None


def paced(rate_hz: float, plant: Plant, options: CoupleOptions) -> float:
    """A control rate, lower where plant and limb are so slow that it serves nothing [Hz]."""
    fastest = float(np.min(plant.time_constants(np.array(plant.u_range))[0]))
    enough = max(WALL_PER_LAG / fastest, PER_LIMB * options.limb_damping / options.limb_inertia)
    return rate_hz if rate_hz <= enough else float(f"{enough:.2g}")


def couple(fit: Fit, gains: Gains | None, options: CoupleOptions, progress: Progress) -> parts.Coupling:
    """`eaid.couple` on what has been read; loops whose gains are not given are left out. DataError where the fit holds
    no nonlinear model, UsageError for a torque that it does not hold, GainsError for a loop that is unstable without
    any wall."""
    refuse_other_units(fit, gains)
    plant, unit = plant_of(fit), fit.data.output_unit
    if plant is None:
        raise DataError("the fit holds no nonlinear model, which walls are worked out on; fit clutch logs with it")
    if unit not in parts.UNITS:
        said = f"in {unit}" if unit else "without a unit"
        raise DataError(f"a wall is made of a torque in N·m or a force in N, and the fit's output is {said}")
    turns = unit == "N·m"
    if options.encoder_counts is not None and not turns:
        raise UsageError("«encoder_counts»: are those of a turn, and a force in N acts along a line; leave it out")
    made_for = gains.margins.timing.rate_hz if gains is not None and gains.margins is not None else None
    rate_hz = options.rate_hz or made_for or paced(control_rate(fit), plant, options)
    delay = options.delay_samples + round(fit.dead_time_s * rate_hz)
    timing = Timing(rate_hz, options.pwm_hz or None, delay)
    laws = {"rc": law_of(gains, "rc"), "rc-no-rate": law_of(gains, "rc"), "pi": law_of(gains, "pi")}
    held = [loop for loop in LOOPS if loop not in laws or laws[loop] is not None]
    loops = held if options.loops == LOOPS else list(options.loops)
    low, high = (float(plant.steady(u)) for u in plant.u_range)
    spread = (max(share * high, low + 0.01 * (high - low)) for share in (0.2, 0.4, 0.6, 0.8))
    rounded = (float(f"{torque:.2g}") for torque in spread)
    torques = options.torque or tuple(dict.fromkeys(min(max(torque, low), high) for torque in rounded))
    walls = []
    with progress("walls", len(torques) * len(loops)) as tick:
        for torque, loop in itertools.product(torques, loops):
            channel = channel_of(loop, plant, torque, laws.get(loop), timing.step_s)
            if margins.spectral_radius(channel.law, channel.point.plant, timing) >= 1:
                raise GainsError(
                    f"the loop {loop} is unstable at {torque:g} without any wall, {timing.words()}; "
                    "no stiffness can be rendered on it, choose other gains or timing"
                )
            passive = passive_stiffness(channel, timing, options)
            K, omega = stable_stiffness(channel, timing, options)
            stable = finite(K)
            replayed = replayed_stiffness(channel, options, timing, K, omega) if options.replay and stable else None
            walls.append(parts.Wall(loop, torque, channel.point.duty_pct, finite(passive), stable, replayed))
            tick()
    idle = [abs(run.baseline_nm) for run in fit.data.sources if run.baseline_nm is not None]
    drag = options.idle_drag_nm if options.idle_drag_nm is not None or not idle else float(np.mean(idle))
    highest, counts, flat = max(torques), options.encoder_counts, plant_numbers(plant)
    # half a second after the torque was let go
    x1, x2 = plant_step(flat, *plant_rest(flat, highest), 0.0, 0.5)
    left = x1 + flat.z * x2
    encoder = None if counts is None or drag is None else 2 * drag / (2 * math.pi / counts)
    slip = options.rotor_rpm * 2 * math.pi / 60 - options.limb_speed_rad_s if turns else None
    impedance = parts.Impedance(drag, left, encoder, slip, 2 * left)
    told = [*_findings(walls, options, impedance, unit), *of_this_mounting(fit, "walls")]
    if fit.dead_time_s > 0:
        told.append(finding("dead-time-replayed", "walls", dead_time_s=fit.dead_time_s))
    return parts.Coupling(
        options=replace(options, rate_hz=rate_hz), output_unit=unit, walls=tuple(walls), impedance=impedance,
        findings=ranked(told),
    )  # fmt: skip


def _findings(walls: list[parts.Wall], options: CoupleOptions, impedance: parts.Impedance, unit: str) -> list[Finding]:
    findings: list[Finding] = []
    per, without = parts.UNITS[unit][0], {wall.torque_nm: wall.K_stable for wall in walls if wall.loop == "rc-no-rate"}
    for wall in walls:
        stable, slower, limit = wall.K_stable, without.get(wall.torque_nm), impedance.encoder_K
        at = partial(finding, torque_nm=wall.torque_nm, unit=unit, per=per, stable=stable)
        if options.wall is not None and stable is not None and stable < options.wall:
            findings.append(at("wall-beyond-stable", wall.loop, wanted=options.wall))
        if wall.loop == "rc" and slower is not None and stable is not None and stable > 3 * slower:
            findings.append(at("wall-by-rate", "rc", without=slower))
        if limit is not None and (stable is None or stable > limit):
            findings.append(at("wall-beyond-encoder", wall.loop, encoder=limit, drag=impedance.idle_drag_nm))
    short = -(impedance.slip_margin_rad_s or 0.0)
    if short > 0:
        needed = options.limb_speed_rad_s * 60 / (2 * math.pi)
        findings.append(finding("clutch-cannot-turn", "rotor", short=short, needed_rpm=needed))
    return findings
