"""The white noise that logs show on the torque: what a controller's proportional action turns into chattering."""

import numpy as np

from eaid.steps.stepset import StepSet


def white_noise_nm(stepset: StepSet) -> float:
    """Standard deviation of the white part of the noise [N·m], the median over runs.

    Second differences take away the curve and everything slow; on white noise of sd σ they have √6 σ.
    """
    found = []
    for level in stepset.levels:
        for run in level.runs:
            second = np.diff(run[np.isfinite(run)], n=2)
            if len(second) > 1:
                found.append(float(np.sqrt(np.mean(second * second) / 6)))
    return float(np.median(found)) if found else 0.0
