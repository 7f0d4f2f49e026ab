"""A sequence of levels and holds within the limits of a rig, and the changes of the input that the rig then plays.

Inputs are in the rig's own unit, counted from rest.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array
from eaid.errors import UsageError
from eaid.recorded.drive import Drive
from eaid.uncertainty.rig_noise import Noise
from eaid.uncertainty.student_t import t_quantile

PARAMETERS = ("Ts", "tau1", "tau2")
MOST_ENGAGEMENTS = 60
BLOCKS = 12
"""Instants of each hold at which the sensitivities are taken."""
RAMP_S = 0.05
"""An input whose rate is limited goes in steps this long [s]."""
COARSE = 4
"""Steps of a ramp while sequences are compared; the one that is taken has steps of `RAMP_S`."""
FULL_DUTY = 100.0
"""Highest input of a rig in %."""


@dataclass(frozen=True)
class Limits:
    """What the rig allows."""

    input: tuple[float, float] = (10.0, 100.0)
    """Lowest and highest input above rest."""
    rate_per_s: float = 0.0
    """Fastest change of the input [its unit/s]; 0: any."""
    hold_s: tuple[float, float] = (0.3, 30.0)
    """Shortest and longest hold."""
    rest_s: float = 5.0
    """Length of a return to rest, and of the rest before the first level."""
    engagements: int = 4
    """Stretches under load between rests, at least: their scatter is to be seen."""
    work_s: float = 0.0
    """Longest stretch under load [s]; 0: any."""
    longest_s: float = 3600.0
    """Longest sequence that is looked for."""
    unit: str = "%"
    """Of the input."""


@dataclass(frozen=True, eq=False)
class HoldSequence:
    """Levels and holds, 0 for a rest."""

    input: Array
    hold_s: Array

    @property
    def time_s(self) -> float:
        """Rig time, without ramps."""
        return float(self.hold_s.sum())


def check(limits: Limits, wanted: Mapping[str, float]) -> None:
    """Refuse limits and widths that mean nothing."""
    faults = []
    low, high = limits.input
    if not 0 < low < high < np.inf:
        faults.append(f"«duty» {low:g}:{high:g}: give two inputs that rise, above 0")
    elif limits.unit == "%" and high > FULL_DUTY:
        faults.append(f"«duty» {low:g}:{high:g}: a duty ends at 100 %")
    if not 0 < limits.hold_s[0] < limits.hold_s[1]:
        faults.append(f"«hold» {limits.hold_s[0]:g}:{limits.hold_s[1]:g}: give the shortest and the longest hold")
    if 0 < limits.rate_per_s * limits.hold_s[1] < high:
        faults.append(
            f"«rate» {limits.rate_per_s:g}: a change to {high:g} takes {high / limits.rate_per_s:g} s, more than the "
            "longest hold; give a faster rate or a longer «hold»"
        )
    if limits.rest_s < 0 or limits.rate_per_s < 0 or limits.work_s < 0 or limits.engagements < 1:
        faults.append("«rest», «rate» and «work» are 0 or more, and there is one engagement at least")
    for name, width in wanted.items():
        if name not in PARAMETERS or not 0 < width < 100:
            faults.append(f"«want» {name}={width:g}: write a parameter of {', '.join(PARAMETERS)} and a percentage")
    if faults or not wanted:
        raise UsageError(*(faults or ["«want»: say at least one width, as tau2=6"]))


def refuse_scattered(noise: Noise, wanted: Mapping[str, float]) -> None:
    """Refuse widths that the scatter between engagements keeps out of reach, however many there are."""
    faults = []
    for name, scatter in zip(PARAMETERS, noise.scatter, strict=True):
        least = float(100 * np.expm1(scatter * of_mean(MOST_ENGAGEMENTS)))
        if least > wanted.get(name, np.inf):
            faults.append(
                f"«want» {name}={wanted[name]:g}: not reachable in {MOST_ENGAGEMENTS} engagements: {name} scatters by "
                f"{100 * scatter:.3g} % from one to the next, which leaves ± {least:.3g} % at best; want "
                f"{1.5 * least:.2g} % or more"
            )
    if faults:
        raise UsageError(*faults)


def of_mean(count: int) -> float:
    """Half-width of the 95 % interval of the mean of so many values, in their standard deviations."""
    return t_quantile(count - 1 or 1) / float(count**0.5)


def drive_of_sequence(whole: HoldSequence, limits: Limits) -> Drive:
    """A sequence for the kernel: some instants of each hold, each with the time that it stands for as its weight."""
    changes = breaks_of(whole, limits, COARSE)
    starts, level = np.array(changes[:-1]).T
    hold = np.diff(np.append(starts, changes[-1][0]))
    short = (limits.rate_per_s > 0) & (hold <= 1.5 * RAMP_S)  # the steps of a ramp
    count = np.where(short, 1, BLOCKS)
    of = np.repeat(np.arange(len(hold)), count)
    place = np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count)
    edges = [(k / count[of]) ** 2 * hold[of] for k in (place, place + 1)]
    middle, weight = 0.5 * (edges[0] + edges[1]), edges[1] - edges[0]
    t = np.concatenate([starts, starts[of] + middle])
    order = np.argsort(t, kind="stable")
    duty, at = np.unique(level, return_inverse=True)
    return Drive(
        np.append(np.diff(t[order]), 0.0),
        at[np.concatenate([np.arange(len(hold)), of])[order]].astype(np.int64),
        duty,
        np.ones(len(t), dtype=np.int64),
        np.zeros(len(t)),
        np.concatenate([np.zeros(len(hold)), weight])[order],
        False,
        True,
    )


def breaks_of(whole: HoldSequence, limits: Limits, most: int = 10**6) -> tuple[tuple[float, float], ...]:
    """(from when [s], input) with ramps where the rate is limited, in milliseconds; the last entry ends it.

    A ramp has as many steps as `RAMP_S` asks for, `most` of them at most.
    """
    found: list[tuple[float, float]] = []
    now, before = 0.0, 0.0
    for duty, hold in zip(whole.input.tolist(), whole.hold_s.tolist(), strict=True):
        if limits.rate_per_s > 0 and duty != before:
            ramp_s = abs(duty - before) / limits.rate_per_s
            count = min(int(np.ceil(ramp_s / RAMP_S)), most)
            for k in range(1, count):
                found.append((now, before + (duty - before) * k / count))
                now += max(RAMP_S, ramp_s / most)
        found.append((now, duty))
        now = round(now + max(hold, 1e-3), 3)
        before = duty
    merged = [one for k, one in enumerate(found) if k == 0 or one[1] != found[k - 1][1]]
    return (*merged, (now, 0.0))
