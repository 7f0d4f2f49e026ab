"""Which way an output goes: the sign that makes the torque of a set's steps positive.

A step is evidence where its mean change is beyond what the slope of its own idle time would have made of it, and
beyond its noise. One sign for all steps of one direction of input, since a level without torque has that of its noise.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from eaid.findings import Finding, finding
from eaid.logs.run import Run
from eaid.steps.baseline import without_spikes
from eaid.steps.noise import STANDARD_ERRORS, block_error, block_means, line
from eaid.steps.step import Step

BEYOND_DRIFT = 1.5
"""A change counts as a step's where it exceeds so many times what the idle slope explains."""
SMALL = 0.2
"""Share of the usual change below which a sign of its own is not held against a step."""


@dataclass(frozen=True)
class Direction:
    """Signs of a set, and what is to be said of them."""

    signs: Mapping[bool, float]
    """Sign for positive inputs (False) and negative ones (True)."""
    findings: tuple[Finding, ...] = ()

    def of(self, run: Run) -> float:
        """The sign of one run: of a step from level to level its own, whichever way the input goes."""
        if run.from_level != 0.0:
            return -1.0 if float(Step(run).rise.mean()) < 0 else 1.0
        return self.signs[(run.level or 0.0) < 0]


def direction(runs: Sequence[Run], keep: bool = False) -> Direction:
    """Signs of cut runs; `keep` forbids turning any."""
    findings: list[Finding] = []
    signs = {False: 1.0, True: 1.0}
    for negative in signs:
        rising = [r for r in runs if r.edge == "rising" and r.from_level == 0 and ((r.level or 0.0) < 0) is negative]
        changes = [(run, *_change(Step(run))) for run in rising]
        clear = [(run, change) for run, change, evident in changes if evident]
        if not clear:
            continue
        sign = -1.0 if sum(change for _, change in clear) < 0 else 1.0
        usual = float(np.median([abs(change) for _, change in clear]))
        odd = [run for run, change in clear if change * sign < -SMALL * usual]
        findings += [
            finding("sign-differs", run.name, (abs(run.level or 0.0),), siblings=len(clear) - 1) for run in odd
        ]
        if sign < 0 and not keep:
            signs[negative] = sign
            findings.append(finding("signs-turned", "data", runs=len(rising)))
    return Direction(signs, tuple(findings))


def _change(step: Step) -> tuple[float, bool]:
    """Mean change of a step, and whether it is evidence of a direction."""
    change = float(step.rise.mean())
    idle, _ = without_spikes(step.idle, abs(change))
    explained = 0.0
    if len(idle) >= 20 and step.run.from_level == 0.0:
        means = block_means(idle)
        at = (np.arange(len(means)) + 0.5) / len(means)
        slope, error, _ = line(at, means)
        lasts = float(step.run.time_s[step.start - 1] - step.run.time_s[0])
        if abs(slope) > STANDARD_ERRORS * error and lasts > 0:
            # from the middle of the idle time, or its end, to the middle of the window
            explained = slope * (0.5 + 0.5 * float(step.time_s[-1]) / lasts)
    same_way = explained * change > 0
    beyond = abs(change) > BEYOND_DRIFT * abs(explained) if same_way else True
    return change, beyond and abs(change) > STANDARD_ERRORS * block_error(step.rise) / np.sqrt(20)
