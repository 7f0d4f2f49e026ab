"""What a plan may promise: the experiment is simulated some times over, and made larger until its own intervals keep
the wanted widths.

Of n simulated widths the m-th least is kept by the next recording with probability m/(n + 1). The noise of a simulation
is that of the fit: white noise of density s0, coloured noise of density s1 as a share of the torque, a sine where the
ripple is periodic, and the scatter between runs.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import sqrt
from typing import Protocol, TypeVar

from eaid.synth.disturbance import NONE, Disturbance
from eaid.uncertainty.noise import Noise

RATE_HZ = 100.0
"""Samples a second of a simulated recording."""
MEMORY_S = 0.05
"""Time constant of its coloured noise [s]."""
POWER = 0.7
"""Power of the excess by which a plan is asked for narrower: widths fall faster than their prediction."""
LEAST, MOST = 1.03, 3.0
"""Least factor by which a width that was not kept is asked for narrower, and the excess that counts at most."""
ROUNDS = 6
"""Times that a plan is made larger."""

Widths = dict[str, float]
"""Half-width of the 95 % interval at the worst input [%], by parameter; infinite where there is none."""


class Planned(Protocol):
    """An experiment that was designed."""

    @property
    def met(self) -> bool:
        """Whether its predicted widths are those wanted."""


P = TypeVar("P", bound=Planned)


def enlarged(
    make: Callable[[Mapping[str, float]], P],
    measure: Callable[[P], list[Widths]],
    wanted: Mapping[str, float],
    keeping: int,
) -> tuple[P, list[Widths]]:
    """The plan that `make` gives for the wanted widths [%], larger until `keeping` recordings keep each; their widths.

    A width measured too wide is asked for narrower in the next round. A plan that falls short even by its prediction is
    as large as the limits allow, and stays.
    """
    asked = dict(wanted)
    plan = make(asked)
    rows = measure(plan)
    for _ in range(ROUNDS):
        excess = over(kept_widths(rows, keeping), wanted)
        if not plan.met or max(excess.values()) <= 1:
            break
        for name, ratio in excess.items():
            if ratio > 1:
                asked[name] /= max(LEAST, min(ratio, MOST) ** POWER)
        larger = make(asked)
        if larger != plan:
            plan, rows = larger, measure(larger)
    return plan, rows


def kept_widths(rows: Sequence[Widths], keeping: int) -> Widths:
    """The width that `keeping` of the simulated recordings keep, each parameter by itself."""
    return {name: sorted(row[name] for row in rows)[keeping - 1] for name in rows[0]}


def over(widths: Mapping[str, float], wanted: Mapping[str, float]) -> dict[str, float]:
    """Widths over the wanted ones, of what is wanted."""
    return {name: widths[name] / width for name, width in wanted.items()}


def finite(widths: Mapping[str, float]) -> dict[str, float | None]:
    """Widths as a result holds them: None where there is no interval."""
    return {name: width if width < float("inf") else None for name, width in widths.items()}


def disturbance_of(noise: Noise) -> Disturbance:
    """The noise and the scatter of a fit as a simulated recording has them."""
    return replace(
        NONE,
        white_nm=sqrt(noise.sensor_nm2_s * RATE_HZ),
        coloured=sqrt(noise.ripple_s / (2 * MEMORY_S)),
        coloured_s=MEMORY_S,
        ripple=0.0 if noise.periodic is None else noise.periodic.amplitude,
        gain_scatter=min(noise.scatter[0], 0.3),
        tau1_scatter=noise.scatter[1],
        tau2_scatter=noise.scatter[2],
    )


def rotor_hz(noise: Noise) -> float:
    """Frequency of the periodic ripple [Hz]; 0 without one."""
    return 0.0 if noise.periodic is None else 1 / noise.periodic.period_s
