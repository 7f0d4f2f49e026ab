"""A design's gains on the fitted plant and a reference: the errors that stand beside the ultimate bound."""

import numpy as np

from eaid.control.pi import PIGains, pi_start, pi_step
from eaid.control.rc import RCGains, rc_start, rc_step
from eaid.models.parameters import Nonlinear
from eaid.replay.controllers import Controller
from eaid.replay.loop import replay
from eaid.replay.metrics import tracking
from eaid.replay.plant import plant_parameters
from eaid.replay.references import Reference
from eaid.replay.rig import Rig
from eaid.results.gains import Replayed, Tracking

STEADY = Rig()
"""No noise, no latching, duty within its limits."""


def steepest_nm_s(reference: Reference) -> float:
    """Largest slope of a reference [N·m/s], by central differences at its rate (§4.8)."""
    return float(np.abs(np.gradient(reference.torque_nm, reference.dt_s)).max())


def rc_controller(gains: RCGains) -> Controller:
    """The robust controller, ready to replay."""
    return Controller("rc", rc_step, gains, rc_start())


def pi_controller(gains: PIGains) -> Controller:
    """The PI controller, ready to replay."""
    return Controller("pi", pi_step, gains, pi_start())


def replayed(
    plant: Nonlinear, controller: Controller, reference: Reference, rig: Rig = STEADY, seed: int = 0
) -> Tracking:
    """Tracking metrics of one controller on one plant, counted from where the reference says."""
    done = replay(plant_parameters(plant), controller, reference.torque_nm, rig, reference.dt_s, seed)
    begin = round(reference.counted_from_s / reference.dt_s)
    return tracking(
        done.reference_nm[begin:], done.torque_nm[begin:], done.duty_pct[begin:], reference.dt_s, done.limits_pct
    )


def beside_the_bound(plant: Nonlinear, rc: RCGains, pi: PIGains, reference: Reference, name: str) -> Replayed:
    """What both controllers do on the fitted plant without noise, and how steep the reference is."""
    return Replayed(
        reference=name,
        slope_nm_s=steepest_nm_s(reference),
        counted_from_s=reference.counted_from_s,
        rc=replayed(plant, rc_controller(rc), reference),
        pi=replayed(plant, pi_controller(pi), reference),
    )
