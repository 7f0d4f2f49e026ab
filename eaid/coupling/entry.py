"""A fit and gains → walls: what `eaid couple` and `eaid.couple` call."""

import numpy as np

from eaid.control.gains import pi_gains, rc_gains
from eaid.control.plant import plant_of
from eaid.coupling.couple import couple, default_torques
from eaid.coupling.options import CoupleOptions
from eaid.errors import DataError
from eaid.progress import Progress
from eaid.results.codec import to_plain
from eaid.results.coupling import Coupling
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.uncertainty.draw import draw_plants

__all__ = ["CoupleOptions", "couple_fit"]


def couple_fit(fit: Fit, gains: Gains | None, options: CoupleOptions, progress: Progress) -> Coupling:
    """The stiffest walls on a fitted plant; DataError where the fit holds no nonlinear model."""
    plant = plant_of(fit)
    if plant is None:
        raise DataError("the fit holds no nonlinear model, which walls are worked out on; fit clutch logs with it")
    rc = rc_gains(gains) if gains is not None else None
    pi = pi_gains(gains) if gains is not None else None
    drawn = draw_plants(to_plain(fit), options.plants, options.seed) if options.plants else []
    torques = options.torques or default_torques(plant)
    with progress("walls", len(torques) * len(options.loops)) as tick:
        return couple(plant, rc, pi, options, drawn, idle_drag_nm(fit), fit.data.output_unit, tick)


def idle_drag_nm(fit: Fit) -> float | None:
    """Size of the idle output, mean over the runs; None where no run says it."""
    known = [abs(run.baseline_nm) for run in fit.data.sources if run.baseline_nm is not None]
    return float(np.mean(known)) if known else None
