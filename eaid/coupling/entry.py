"""A fit and gains → walls: what `eaid couple`, `eaid.couple` and replays call."""

import math
from dataclasses import replace

import msgspec
import numpy as np

from eaid.control.gains import pi_gains, plant_of, rc_gains
from eaid.control.margins import Timing
from eaid.coupling.couple import Loops, couple, default_torques
from eaid.coupling.stiffness import Coupled, Limb, operating_point, stable_stiffness
from eaid.errors import DataError
from eaid.findings import finding, ranked
from eaid.models.nonlinear import steady_torque
from eaid.options import LOOPS, CoupleOptions
from eaid.progress import Progress
from eaid.replay.rehab import RESISTED_FROM_DEG
from eaid.results.coupling import Coupling
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.replay import Replay
from eaid.uncertainty.draw import draw

MOST_DELAY = 100
"""Each sample of delay is a state of the loop's linear map."""


def couple_fit(fit: Fit, gains: Gains | None, options: CoupleOptions, progress: Progress) -> Coupling:
    """The stiffest walls on a fitted plant; DataError where the fit holds no nonlinear model."""
    plant = plant_of(fit)
    if plant is None:
        raise DataError("the fit holds no nonlinear model, which walls are worked out on; fit clutch logs with it")
    late = round(fit.dead_time_s * options.rate_hz)
    if late > MOST_DELAY:
        raise DataError(
            f"the steps show a dead time of {fit.dead_time_s:.3g} s, {late} samples; walls are worked out for "
            f"{MOST_DELAY} at most: a lower «rate_hz»"
        )
    options = replace(options, delay_samples=options.delay_samples or late)
    drawn = draw(fit, options.plants, options.seed) if options.plants else None
    plants = drawn.plants if drawn is not None else ()
    torques = options.torque or default_torques(plant)
    idle = [abs(run.baseline_nm) for run in fit.data.sources if run.baseline_nm is not None]
    drag_nm = float(np.mean(idle)) if idle else None
    with progress("walls", len(torques) * len(options.loops)) as tick:
        found = couple(plant, rc_gains(gains), pi_gains(gains), options, plants, drag_nm, fit.data.output_unit, tick)
    findings = drawn.findings if drawn is not None else ()
    return msgspec.structs.replace(found, findings=ranked((*found.findings, *findings)))


def with_wall_findings(replay: Replay, fit: Fit, gains: Gains | None) -> Replay:
    """A rehabilitation's replay with a finding for each loop whose springs lie beyond what it keeps stable.

    Looked at where the spring is pushed half and fully, on the exercise's limb alone, without what the user adds.
    """
    exercise, plant = replay.head.exercise, plant_of(fit)
    if exercise is None or plant is None:
        return replay
    rig = replay.head.rig
    timing = Timing(1 / (replay.head.dt_s or 1e-3), rig.pwm_hz or None, rig.delay_samples)
    setup = Loops(rc_gains(gains), pi_gains(gains), Limb(exercise.inertia_kgm2, exercise.damping_nms), timing)
    pushed = math.radians(exercise.centre_deg + exercise.amplitude_deg - RESISTED_FROM_DEG)
    low, high = (float(steady_torque(plant, u)) for u in plant.u_range)
    findings = []
    for loop in (name for name in replay.records if name in LOOPS):
        for stiffness in (exercise.soft_nm_rad, exercise.hard_nm_rad):
            for torque in (0.5 * stiffness * pushed, stiffness * pushed):
                if not low <= torque <= high:
                    continue
                channel, _ = setup.around(loop, plant, operating_point(plant, torque))
                stable = stable_stiffness(Coupled([channel], setup.limb, setup.timing))
                if stable < stiffness:
                    unit = fit.data.output_unit
                    findings.append(
                        finding(
                            "wall-beyond-stable", loop, wanted=stiffness, stable=stable, torque_nm=torque, unit=unit
                        )
                    )
    head = msgspec.structs.replace(replay.head, findings=ranked((*replay.findings, *findings)))
    return replace(replay, head=head)
