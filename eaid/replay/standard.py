"""A design's gains on the fitted plant and a reference: the errors that stand beside the ultimate bound."""

import numpy as np

from eaid.control.pi import PIGains
from eaid.control.rc import RCGains
from eaid.models.parameters import Nonlinear
from eaid.replay.controllers import Controller, pi_controller, rc_controller
from eaid.replay.loop import replay
from eaid.replay.plant import plant_parameters
from eaid.replay.references import Reference
from eaid.replay.rig import Rig
from eaid.replay.scenarios import tracked
from eaid.results.gain_checks import Replayed, Tracking


def steepest_nm_s(reference: Reference) -> float:
    """Largest slope of a reference [N·m/s], by central differences at its rate (§4.8)."""
    return float(np.abs(np.gradient(reference.torque_nm, reference.dt_s)).max())


def replayed(
    plant: Nonlinear, controller: Controller, reference: Reference, rig: Rig | None = None, seed: int = 0
) -> Tracking:
    """Tracking metrics of one controller on one plant, counted from where the reference says."""
    flat = plant_parameters(plant)
    return tracked(replay(flat, controller, reference.torque_nm, rig or Rig(), reference.dt_s, seed), reference)


def beside_the_bound(plant: Nonlinear, rc: RCGains, pi: PIGains, reference: Reference, name: str) -> Replayed:
    """What both controllers do on the fitted plant without noise, and how steep the reference is."""
    return Replayed(
        reference=name,
        slope_nm_s=steepest_nm_s(reference),
        counted_from_s=reference.counted_from_s,
        rc=replayed(plant, rc_controller(rc), reference),
        pi=replayed(plant, pi_controller(pi), reference),
    )
