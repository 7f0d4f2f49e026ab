"""`couple`: the stiffest walls of every loop at every torque, and what else limits them (docs/coupling.md)."""

import math
from collections.abc import Callable, Iterable
from typing import Any

import msgspec
import numpy as np

from eaid.control.pi import PIGains
from eaid.control.rc import RCGains
from eaid.control.timing import Timing
from eaid.coupling.linear import Law, Point, linearised, operating_point, step_of
from eaid.coupling.motion import Drive, replayed_stiffness
from eaid.coupling.options import CoupleOptions
from eaid.coupling.sampled import Channel, Coupled, Limb
from eaid.coupling.stiffness import (
    needed_damping,
    passive_stiffness,
    stable_stiffness,
)
from eaid.errors import GainsError, UsageError
from eaid.findings import Finding, finding, ranked
from eaid.models.nonlinear import steady_torque
from eaid.models.parameters import Nonlinear
from eaid.replay.plant import plant_parameters, plant_step
from eaid.results import coupling as parts

SHOWN_POINTS = 200
"""Frequencies of a stored curve."""
REGION_POINTS = 9
AFTER_S = 0.5
"""Time after which residual torque and the step at a turn are read [s]."""


def couple(
    plant: Nonlinear,
    rc: RCGains | None,
    pi: PIGains | None,
    options: CoupleOptions = CoupleOptions(),  # noqa: B008 - frozen
    drawn: Iterable[Nonlinear] = (),
    idle_drag_nm: float | None = None,
    unit: str = "N·m",
    advance: Callable[[], None] = lambda: None,
) -> parts.Coupling:
    """How stiff a virtual wall each loop may render on a limb.

    Parameters
    ----------
    plant
        The fitted nonlinear model.
    rc, pi
        Gains; loops whose gains are None are left out where `options.loops` is the default.
    options
        Limb, timing, torques and loops.
    drawn
        Plants drawn from the fit's uncertainty, for what 95 % keep.
    idle_drag_nm
        Torque of the idle clutch, where the logs show it.
    unit
        Of the torque, for findings.
    advance
        Called once per loop and torque.

    Raises
    ------
    UsageError
        A torque that the identified inputs do not hold, or an option out of range.
    GainsError
        A loop that is unstable without any wall.
    """
    timing, limb = options.timing, options.limb
    loops = [loop for loop in options.loops if _has_gains(loop, rc, pi)] or list(options.loops)
    torques = options.torques or default_torques(plant)
    walls, regions, curves, kept = [], [], [], []
    for torque in torques:
        point = operating_point(plant, torque)
        for loop in loops:
            channel, drive = _loop(loop, plant, point, rc, pi, timing)
            wall, curve = _wall(loop, [channel], limb, timing, options.virtual_damping, torque, point.duty_pct)
            if options.replay and wall.K_stable:
                found = replayed_stiffness(drive, limb, timing, wall.K_stable)
                wall = msgspec.structs.replace(wall, K_replayed=found)
            walls.append(wall)
            curves.append(curve)
            regions.append(_region(loop, [channel], limb, timing, torque))
            advance()
    population = list(drawn)
    if population:
        kept = [_kept(loop, torque, population, rc, pi, limb, timing, options) for torque in torques for loop in loops]
    pair, bias, left_out = _pair(plant, loops, torques, rc, pi, limb, timing, options)
    drag = options.idle_drag_nm if options.idle_drag_nm is not None else idle_drag_nm
    impedance = _impedance(plant, max(torques), drag, options)
    told = _findings(walls, options, impedance, unit)
    if left_out:
        told.append(
            finding("pair-bias-cut", "pair", bias=bias, unit=unit, torques=", ".join(f"{t:g}" for t in left_out))
        )
    return parts.Coupling(
        options=parts.CoupleRecord(
            options.limb_inertia, options.limb_damping, options.virtual_damping, options.rate_hz, options.pwm_hz,
            options.delay_samples, options.sensor_hz,
        ),
        seed=options.seed, plants=len(population), output_unit=unit, walls=tuple(walls), pair=tuple(pair),
        pair_bias_nm=bias, regions=tuple(regions), curves=tuple(curves), kept=tuple(kept), impedance=impedance,
        findings=ranked(told),
    )  # fmt: skip


def default_torques(plant: Nonlinear) -> tuple[float, ...]:
    """Four torques over what the identified inputs hold, to two digits."""
    low, high = (float(steady_torque(plant, u)) for u in plant.u_range)
    return tuple(
        float(f"{t:.2g}") for t in (max(share * high, low + 0.01 * (high - low)) for share in (0.2, 0.4, 0.6, 0.8))
    )


def stable_wall(
    loop: str, plant: Nonlinear, torque_nm: float, rc: RCGains | None, pi: PIGains | None, limb: Limb, timing: Timing
) -> float:
    """The stiffest wall that one loop keeps stable around one torque [N·m/rad], linear and sampled."""
    channel, _ = _loop(loop, plant, operating_point(plant, torque_nm), rc, pi, timing)
    return stable_stiffness(Coupled([channel], limb, timing))


def _has_gains(loop: str, rc: RCGains | None, pi: PIGains | None) -> bool:
    return (pi is not None) if loop == "pi" else (rc is not None or loop not in ("rc", "rc-no-rate"))


def _loop(
    loop: str,
    plant: Nonlinear,
    point: Point,
    rc: RCGains | None,
    pi: PIGains | None,
    timing: Timing,
    weight: float = 1.0,
) -> tuple[Channel, Drive]:
    """One clutch around a point, linear and as it is; GainsError where it is unstable without a wall."""
    step, start = step_of(loop, plant, point, rc, pi, timing.step_s)
    law: Law = linearised(step, start, point)
    channel = Channel(point, law, weight)
    poles = np.abs(Coupled([channel], Limb(), timing).poles(0.0))
    if poles.max() > 1 + 1e-9:
        raise GainsError(
            f"the loop {loop} is unstable at {point.torque_nm:g} without any wall (spectral radius {poles.max():.4f}); "
            "no stiffness can be rendered on it, choose other gains or timing"
        )
    return channel, Drive(plant, point, step, start)


def _wall(
    loop: str, channels: list[Channel], limb: Limb, timing: Timing, damping: float, torque: float, duty: float | None
) -> tuple[parts.Wall, parts.Curve]:
    needed, coupled = needed_damping(channels, timing), Coupled(channels, limb, timing)
    K_passive, limit = passive_stiffness(needed, limb.damping_nms, damping)
    K_stable = stable_stiffness(coupled, damping)
    lost = _lost_hz(coupled, K_stable, damping)
    limit_hz = 0.0 if limit <= needed.omega[0] else limit / (2 * math.pi)  # the slowest looked at stands for rest
    chosen = np.unique(np.linspace(0, len(needed.omega) - 1, SHOWN_POINTS).astype(int))
    wall = parts.Wall(loop, torque, duty, _known(K_passive), limit_hz, _known(K_stable), lost)
    curve = parts.Curve(
        loop, torque,
        tuple((needed.omega[chosen] / (2 * math.pi)).tolist()),
        tuple(needed.damping(1.0)[chosen].tolist()),
        tuple((20 * np.log10(np.abs(needed.response[chosen]))).tolist()),
    )  # fmt: skip
    return wall, curve


def _lost_hz(coupled: Coupled, stiffness: float, damping: float) -> float | None:
    if not 0 < stiffness < math.inf:
        return None
    poles = coupled.poles(stiffness, damping)
    worst = poles[int(np.argmax(np.abs(poles)))]
    return float(abs(np.angle(worst)) * coupled.timing.rate_hz / coupled.timing.pattern[0] / (2 * math.pi))


def _region(loop: str, channels: list[Channel], limb: Limb, timing: Timing, torque: float) -> parts.Region:
    """K over B_v, from 0 to twice the limb's damping."""
    needed, coupled = needed_damping(channels, timing), Coupled(channels, limb, timing)
    points = tuple(
        parts.RegionPoint(
            damping,
            _known(passive_stiffness(needed, limb.damping_nms, damping)[0]),
            _known(stable_stiffness(coupled, damping)),
        )
        for damping in np.linspace(0.0, 2 * limb.damping_nms, REGION_POINTS).tolist()
    )
    return parts.Region(loop, torque, points)


def _pair(
    plant: Nonlinear, loops: list[str], torques: Iterable[float], rc: RCGains | None, pi: PIGains | None, limb: Limb,
    timing: Timing, options: CoupleOptions,
) -> tuple[list[parts.Wall], float, list[float]]:  # fmt: skip
    """The walls of T1 − T2, each clutch asked for half of the torque beside its bias; torques that it cannot hold."""
    low, high = (float(steady_torque(plant, u)) for u in plant.u_range)
    bias = options.pair_bias_nm if options.pair_bias_nm is not None else 0.5 * (low + high)
    if not low < bias < high:
        raise UsageError(f"«pair_bias_nm» {bias:g}: must lie between {low:.3g} and {high:.3g}, which the inputs hold")
    rows, left_out = [], []
    for torque in torques:
        ends = bias + 0.5 * torque, bias - 0.5 * torque
        if not (low <= ends[1] and ends[0] <= high):
            left_out.append(torque)
            continue
        for loop in loops:
            channels = [
                _loop(loop, plant, operating_point(plant, end), rc, pi, timing, weight)[0]
                for end, weight in zip(ends, (0.5, -0.5), strict=True)
            ]
            rows.append(_wall(loop, channels, limb, timing, options.virtual_damping, torque, None)[0])
    return rows, bias, left_out


def _kept(
    loop: str, torque: float, plants: list[Nonlinear], rc: RCGains | None, pi: PIGains | None, limb: Limb,
    timing: Timing, options: CoupleOptions,
) -> parts.Kept:  # fmt: skip
    """The stiffness that 95 % of the drawn plants, each with a limb of its own, keep."""
    random = np.random.default_rng(options.seed)
    passive, stable = [], []
    for one in plants:
        spread = 1 + options.limb_spread * random.uniform(-1, 1, 2)
        own = Limb(limb.inertia_kgm2 * spread[0], limb.damping_nms * spread[1])
        try:
            channel, _ = _loop(loop, one, operating_point(one, torque), rc, pi, timing)
        except (UsageError, GainsError):  # this plant does not hold the torque, or the loop breaks on it
            passive.append(0.0)
            stable.append(0.0)
            continue
        passive.append(passive_stiffness(needed_damping([channel], timing), own.damping_nms)[0])
        stable.append(stable_stiffness(Coupled([channel], own, timing)))
    return parts.Kept(loop, torque, *(_known(float(np.quantile(v, 0.05, method="lower"))) for v in (passive, stable)))


def _impedance(plant: Nonlinear, torque_nm: float, drag: float | None, options: CoupleOptions) -> parts.Impedance:
    flat = plant_parameters(plant)
    x = plant.C * torque_nm, (1 - plant.C) * torque_nm
    left = sum(plant_step(flat, *x, 0.0, AFTER_S))
    counts = options.encoder_counts
    encoder = None if counts is None or drag is None else 2 * drag / (2 * math.pi / counts)
    rotor = options.rotor_rpm * 2 * math.pi / 60
    return parts.Impedance(drag, left, encoder, rotor - options.limb_speed_rad_s, 2 * left)


def _findings(walls: list[parts.Wall], options: CoupleOptions, impedance: parts.Impedance, unit: str) -> list[Finding]:
    told: list[Finding] = []
    without = {wall.torque_nm: wall.K_stable for wall in walls if wall.loop == "rc-no-rate"}
    for wall in walls:
        own: dict[str, Any] = {"torque_nm": wall.torque_nm, "unit": unit, "stable": wall.K_stable}
        if options.wall is not None and wall.K_stable is not None and wall.K_stable < options.wall:
            told.append(finding("wall-beyond-stable", wall.loop, wanted=options.wall, **own))
        elif wall.K_stable is not None and wall.K_passive is not None and wall.K_stable > 2 * wall.K_passive:
            told.append(finding("wall-not-passive", wall.loop, passive=wall.K_passive, **own))
        slower = without.get(wall.torque_nm)
        if wall.loop == "rc" and slower is not None and wall.K_stable is not None and wall.K_stable > 3 * slower:
            told.append(finding("wall-by-rate", "rc", without=slower, **own))
        limit = impedance.encoder_K
        if limit is not None and (wall.K_stable is None or wall.K_stable > limit):
            told.append(
                finding("wall-beyond-encoder", wall.loop, encoder=limit, drag=impedance.idle_drag_nm, unit=unit)
            )
    short = -(impedance.slip_margin_rad_s or 0.0)
    if short > 0:
        needed = options.limb_speed_rad_s * 60 / (2 * math.pi)
        told.append(finding("clutch-cannot-turn", "rotor", short=short, needed_rpm=needed))
    return told


def _known(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
