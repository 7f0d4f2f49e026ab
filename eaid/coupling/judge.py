"""Gains chosen for stiff walls: what a search of `tune` makes least.

The cost of gains is 1/K, K the stiffest wall that the robust controller without its reference rate renders passively at
the least favourable of four torques. With the rate a wall rests on fractions of a sample (docs/coupling.md).
"""

from collections.abc import Callable

from eaid.control.plant import plant_of
from eaid.control.rc import RCGains
from eaid.coupling.couple import default_torques
from eaid.coupling.linear import operating_point
from eaid.coupling.loops import Loops
from eaid.coupling.options import CoupleOptions
from eaid.coupling.stiffness import needed_damping, passive_stiffness
from eaid.errors import DataError, GainsError
from eaid.results.fit import Fit

UNSTABLE = 1e3
"""Cost of gains whose loop is unstable without any wall [rad/(N·m)]."""


def stiffness_judge(fit: Fit, options: CoupleOptions = CoupleOptions()) -> Callable[[RCGains], float]:  # noqa: B008
    """1/K of the stiffest passive wall of the robust controller [rad/(N·m)]; DataError without a nonlinear model."""
    plant = plant_of(fit)
    if plant is None:
        raise DataError("the fit holds no nonlinear model, which walls are worked out on; fit clutch logs with it")
    points = [operating_point(plant, torque) for torque in options.torques or default_torques(plant)]

    def cost(gains: RCGains) -> float:
        loops = Loops(gains, None, options.limb, options.timing)
        try:
            channels = [loops.around("rc-no-rate", plant, point)[0] for point in points]
        except GainsError:
            return UNSTABLE
        needed = (needed_damping([channel], options.timing) for channel in channels)
        worst = min(passive_stiffness(one, options.limb_damping)[0] for one in needed)
        return 1 / worst if worst > 1 / UNSTABLE else UNSTABLE

    return cost
