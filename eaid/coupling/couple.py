"""`couple`: the stiffest walls of every loop at every torque, and what else limits them (docs/coupling.md)."""

import itertools
import math
from dataclasses import replace
from functools import partial

import numpy as np

from eaid.arrays import Array
from eaid.control.gains import pi_gains, plant_of, rc_gains, refuse_other_units
from eaid.control.margins import Timing, is_stable, known
from eaid.control.pi import PIGains
from eaid.control.rc import RCGains
from eaid.coupling.stiffness import Channel, Limb, channel_of, needed_damping, passive_stiffness, wall_loop
from eaid.errors import DataError, GainsError
from eaid.findings import Finding, finding, ranked
from eaid.models.nonlinear import steady_torque
from eaid.models.parameters import Nonlinear
from eaid.options import LOOPS, CoupleOptions
from eaid.progress import Progress
from eaid.replay.plant import Held, hold_step, plant_parameters, plant_step
from eaid.replay.rehab import limb_steps
from eaid.results import coupling as parts
from eaid.results.fit import Fit
from eaid.results.gains import Gains

BESIDE_RAD = 1e-4  # Where the limb is let go


def swing(drive: Channel, limb: Limb, timing: Timing, stiffness: float, time_s: float) -> Array:
    """Angle of the limb at each sample [rad], shape (n,), from `BESIDE_RAD`, at rest, the torque held at T_0."""
    h, plant, point = timing.step_s, plant_parameters(drive.plant), drive.point
    held = Held(plant.C * point.torque_nm, (1 - plant.C) * point.torque_nm, point.duty_pct, 0)
    state, angle, speed, before = drive.start, BESIDE_RAD, 0.0, point.torque_nm
    waiting = [point.duty_pct] * timing.delay_samples
    period = timing.rate_hz / timing.pwm_hz if timing.pwm_hz else 0.0
    keep, push, drift, lift = limb_steps(limb.inertia_kgm2, limb.damping_nms, h)
    angles = []
    for k in range(round(time_s / h)):
        torque = held.x1 + held.x2
        wanted = point.torque_nm - stiffness * angle
        state, duty = drive.step(state, wanted, (wanted - before) / h, torque)
        before = wanted
        waiting.append(duty)
        held, _ = hold_step(plant, period, h, k, waiting.pop(0), held)
        moment = 0.5 * (torque + held.x1 + held.x2) - point.torque_nm
        angles.append(angle)
        angle, speed = angle + drift * speed + lift * moment, keep * speed + push * moment
        if abs(angle) > 1.0:
            break
    return np.array(angles)


def growth(drive: Channel, limb: Limb, timing: Timing, stiffness: float, time_s: float) -> float:
    """Log of how much the swing grows from the third to the last quarter of the time; below 0: it dies away."""
    angle = np.diff(swing(drive, limb, timing, stiffness, time_s))  # a slow drift of the middle weighs little
    quarter = (round(time_s / timing.step_s) - 1) // 4
    if len(angle) < 4 * quarter:
        return math.inf  # left the range before the time was over
    late, last = (float(np.std(angle[i * quarter : (i + 1) * quarter])) for i in (2, 3))
    return math.log(max(last, 1e-300) / max(late, 1e-300))


def replayed_stiffness(drive: Channel, limb: Limb, timing: Timing, expected: float) -> float | None:
    """The stiffness at which the replay neither grows nor dies away [N·m/rad], near what linear theory expects.

    None where it is not within a factor of two of that.
    """
    turn_s = 2 * math.pi * math.sqrt(limb.inertia_kgm2 / expected)
    time_s = max(20 * turn_s, 200 * timing.step_s)

    def rate(log_stiffness: float) -> float:
        return min(growth(drive, limb, timing, math.exp(log_stiffness), time_s), 20.0)

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


def couple(fit: Fit, gains: Gains | None, options: CoupleOptions, progress: Progress) -> parts.Coupling:
    """How stiff a virtual wall each loop may render on a limb.

    Loops whose gains are not given are left out. Raises DataError where the fit holds no nonlinear model, UsageError
    for a torque that the identified inputs do not hold, and GainsError for a loop that is unstable without any wall.
    """
    refuse_other_units(fit, gains)
    plant, rc, pi, unit = plant_of(fit), rc_gains(gains), pi_gains(gains), fit.data.output_unit
    if plant is None:
        raise DataError("the fit holds no nonlinear model, which walls are worked out on; fit clutch logs with it")
    delay = options.delay_samples or round(fit.dead_time_s * options.rate_hz)
    timing, limb = (
        Timing(options.rate_hz, options.pwm_hz or None, delay),
        Limb(options.limb_inertia, options.limb_damping),
    )
    laws: dict[str, RCGains | PIGains | None] = {"rc": rc, "rc-no-rate": rc, "pi": pi}
    held = [loop for loop in LOOPS if loop not in laws or laws[loop] is not None]
    loops = held if options.loops == LOOPS else list(options.loops)
    torques = options.torque or default_torques(plant)
    walls = []
    with progress("walls", len(torques) * len(loops)) as tick:
        for torque, loop in itertools.product(torques, loops):
            channel = channel_of(loop, plant, torque, laws.get(loop), timing.step_s)
            if not is_stable(channel.law, channel.point.lags, timing):
                raise GainsError(
                    f"the loop {loop} is unstable at {torque:g} without any wall, {timing.words()}; "
                    "no stiffness can be rendered on it, choose other gains or timing"
                )
            walls.append(wall_of(loop, channel, limb, timing, options))
            tick()
    idle = [abs(run.baseline_nm) for run in fit.data.sources if run.baseline_nm is not None]
    drag = options.idle_drag_nm if options.idle_drag_nm is not None or not idle else float(np.mean(idle))
    impedance = _impedance(plant, max(torques), drag, options)
    return parts.Coupling(
        options=replace(options, delay_samples=delay), output_unit=unit, walls=tuple(walls), impedance=impedance,
        findings=ranked(_findings(walls, options, impedance, unit)),
    )  # fmt: skip


def wall_of(loop: str, channel: Channel, limb: Limb, timing: Timing, options: CoupleOptions) -> parts.Wall:
    """The stiffest walls of a loop at one torque."""
    needed, damping = needed_damping(channel, timing), options.virtual_damping
    K_passive, limit = passive_stiffness(needed, limb.damping_nms, damping)
    K_stable, lost = wall_loop(channel, limb, timing).stable(damping)
    return parts.Wall(
        loop, channel.point.torque_nm, channel.point.duty_pct, known(K_passive),
        0.0 if limit <= needed.omega[0] else limit / (2 * math.pi),  # the slowest looked at stands for rest
        known(K_stable), lost / (2 * math.pi) or None,
        replayed_stiffness(channel, limb, timing, K_stable) if options.replay and math.isfinite(K_stable) else None,
    )  # fmt: skip


def default_torques(plant: Nonlinear) -> tuple[float, ...]:
    """Four torques over what the identified inputs hold, to two digits."""
    low, high = (float(steady_torque(plant, u)) for u in plant.u_range)
    return tuple(
        float(f"{t:.2g}") for t in (max(share * high, low + 0.01 * (high - low)) for share in (0.2, 0.4, 0.6, 0.8))
    )


def _impedance(plant: Nonlinear, torque_nm: float, drag: float | None, options: CoupleOptions) -> parts.Impedance:
    flat = plant_parameters(plant)
    x = plant.C * torque_nm, (1 - plant.C) * torque_nm
    left = sum(plant_step(flat, *x, 0.0, 0.5))  # half a second after the torque was let go
    counts = options.encoder_counts
    encoder = None if counts is None or drag is None else 2 * drag / (2 * math.pi / counts)
    rotor = options.rotor_rpm * 2 * math.pi / 60
    return parts.Impedance(drag, left, encoder, rotor - options.limb_speed_rad_s, 2 * left)


def _findings(walls: list[parts.Wall], options: CoupleOptions, impedance: parts.Impedance, unit: str) -> list[Finding]:
    findings: list[Finding] = []
    without = {wall.torque_nm: wall.K_stable for wall in walls if wall.loop == "rc-no-rate"}
    for wall in walls:
        stable, passive, torque = wall.K_stable, wall.K_passive, wall.torque_nm
        at = partial(finding, torque_nm=torque, unit=unit, stable=stable)
        if options.wall is not None and stable is not None and stable < options.wall:
            findings.append(at("wall-beyond-stable", wall.loop, wanted=options.wall))
        elif stable is not None and passive is not None and stable > 2 * passive:
            findings.append(at("wall-not-passive", wall.loop, passive=passive))
        slower = without.get(torque)
        if wall.loop == "rc" and slower is not None and stable is not None and stable > 3 * slower:
            findings.append(at("wall-by-rate", "rc", without=slower))
        limit = impedance.encoder_K
        if limit is not None and (stable is None or stable > limit):
            findings.append(
                finding("wall-beyond-encoder", wall.loop, encoder=limit, drag=impedance.idle_drag_nm, unit=unit)
            )
    short = -(impedance.slip_margin_rad_s or 0.0)
    if short > 0:
        needed = options.limb_speed_rad_s * 60 / (2 * math.pi)
        findings.append(finding("clutch-cannot-turn", "rotor", short=short, needed_rpm=needed))
    return findings
