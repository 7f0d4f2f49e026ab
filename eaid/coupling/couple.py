"""`couple`: the stiffest walls of every loop at every torque, and what else limits them (docs/coupling.md)."""

import math
from collections.abc import Callable, Iterable
from functools import partial

import msgspec
import numpy as np

from eaid.control.operating import known
from eaid.control.pi import PIGains
from eaid.control.rc import RCGains
from eaid.control.timing import Timing
from eaid.coupling.linearised import operating_point
from eaid.coupling.loops import Loops
from eaid.coupling.motion import replayed_stiffness
from eaid.coupling.sampled import Coupled, Limb
from eaid.coupling.stiffness import needed_damping, passive_stiffness, stable_stiffness
from eaid.errors import GainsError, UsageError
from eaid.findings import Finding, finding, ranked
from eaid.models.nonlinear import steady_torque
from eaid.models.parameters import Nonlinear
from eaid.options import CoupleOptions
from eaid.replay.plant import plant_parameters, plant_step
from eaid.results import coupling as parts

AFTER_S = 0.5
"""Time after which residual torque and the step at a turn are read [s]."""


def limb_of(options: CoupleOptions) -> Limb:
    """The limb."""
    return Limb(options.limb_inertia, options.limb_damping)


def timing_of(options: CoupleOptions) -> Timing:
    """When the loop samples and its duty takes effect."""
    return Timing(options.rate_hz, options.pwm_hz or None, options.delay_samples, options.sensor_hz)


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
    setup = Loops(rc, pi, limb_of(options), timing_of(options), options.virtual_damping)
    loops = [loop for loop in options.loops if setup.has_gains(loop)] or list(options.loops)
    torques = options.torque or default_torques(plant)
    walls, regions, curves, kept = [], [], [], []
    for torque in torques:
        point = operating_point(plant, torque)
        for loop in loops:
            channel, drive = setup.around(loop, plant, point)
            wall, curve = setup.wall(loop, [channel], torque, point.duty_pct)
            if options.replay and wall.K_stable is not None:
                found = replayed_stiffness(drive, setup.limb, setup.timing, wall.K_stable)
                wall = msgspec.structs.replace(wall, K_replayed=found)
            walls.append(wall)
            curves.append(curve)
            regions.append(setup.region(loop, [channel], torque))
            advance()
    population = list(drawn)
    if population:
        kept = [_kept(setup, loop, torque, population, options) for torque in torques for loop in loops]
    pair, bias, left_out = _pair(setup, plant, loops, torques, options.pair_bias_nm)
    drag = options.idle_drag_nm if options.idle_drag_nm is not None else idle_drag_nm
    impedance = _impedance(plant, max(torques), drag, options)
    findings = _findings(walls, options, impedance, unit)
    if left_out:
        findings.append(
            finding("pair-bias-cut", "pair", bias=bias, unit=unit, torques=", ".join(f"{t:g}" for t in left_out))
        )
    return parts.Coupling(
        options=parts.CoupleRecord(
            options.limb_inertia, options.limb_damping, options.virtual_damping, options.rate_hz, options.pwm_hz,
            options.delay_samples, options.sensor_hz,
        ),
        seed=options.seed, plants=len(population), output_unit=unit, walls=tuple(walls), pair=tuple(pair),
        pair_bias_nm=bias, regions=tuple(regions), curves=tuple(curves), kept=tuple(kept), impedance=impedance,
        findings=ranked(findings),
    )  # fmt: skip


def default_torques(plant: Nonlinear) -> tuple[float, ...]:
    """Four torques over what the identified inputs hold, to two digits."""
    low, high = (float(steady_torque(plant, u)) for u in plant.u_range)
    return tuple(
        float(f"{t:.2g}") for t in (max(share * high, low + 0.01 * (high - low)) for share in (0.2, 0.4, 0.6, 0.8))
    )


def _pair(
    setup: Loops, plant: Nonlinear, loops: list[str], torques: Iterable[float], bias: float | None
) -> tuple[list[parts.Wall], float, list[float]]:
    """The walls of T1 − T2, each clutch asked for half of the torque beside its bias; torques that it cannot hold."""
    low, high = (float(steady_torque(plant, u)) for u in plant.u_range)
    bias = 0.5 * (low + high) if bias is None else bias
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
                setup.around(loop, plant, operating_point(plant, end), weight)[0]
                for end, weight in zip(ends, (0.5, -0.5), strict=True)
            ]
            rows.append(setup.wall(loop, channels, torque, None)[0])
    return rows, bias, left_out


def _kept(setup: Loops, loop: str, torque: float, plants: list[Nonlinear], options: CoupleOptions) -> parts.Kept:
    """The stiffness that 95 % of the drawn plants, each with a limb of its own, keep."""
    random = np.random.default_rng(options.seed)
    found = []
    for one in plants:
        inertia, damping = 1 + options.limb_spread * random.uniform(-1, 1, 2)
        limb = Limb(setup.limb.inertia_kgm2 * inertia, setup.limb.damping_nms * damping)
        try:
            channel, _ = setup.around(loop, one, operating_point(one, torque))
        except (UsageError, GainsError):  # this plant does not hold the torque, or the loop breaks on it
            found.append((0.0, 0.0))
            continue
        passive = passive_stiffness(needed_damping([channel], setup.timing), limb.damping_nms)[0]
        found.append((passive, stable_stiffness(Coupled([channel], limb, setup.timing))))
    low = np.quantile(found, 0.05, axis=0, method="lower").tolist()
    return parts.Kept(loop, torque, known(low[0]), known(low[1]))


def _impedance(plant: Nonlinear, torque_nm: float, drag: float | None, options: CoupleOptions) -> parts.Impedance:
    flat = plant_parameters(plant)
    x = plant.C * torque_nm, (1 - plant.C) * torque_nm
    left = sum(plant_step(flat, *x, 0.0, AFTER_S))
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
