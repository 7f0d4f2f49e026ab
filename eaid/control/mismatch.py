"""φ from data: how far η is from η̂, in % duty, as the models and the logs show it.

The law supposes Ṫ = b (u − η) with b in [1/B_M, 1/B_m] and |η − η̂(T)| ≤ φ, η̂(T) = (a0 T − c0)/b0. At an instant
with duty u, torque T and slope Ṫ, the least φ that allows this is the distance of u − η̂(T) from the interval B Ṫ,
B in [B_m, B_M].

    shown_by_model   over the steps of the nonlinear model between any two identified duties, and from rest
    shown_by_logs    over the averaged steps of the logs, slope by least squares over 0.1 s, or three samples
    shown_by_levels  over the first-order models of the single levels, η_i(T) = (a_i T − c_i) B_i, each taken as the
                     plant over the whole range of torque
"""

import itertools
from collections.abc import Sequence

import numpy as np

from eaid.arrays import Array
from eaid.control.bounds import LevelB
from eaid.models.nonlinear import steady_torque, time_constants
from eaid.models.parameters import Linear, Nonlinear
from eaid.results.gain_checks import Mismatch
from eaid.steps.stepset import StepSet

WINDOW_S = 0.1
"""Slopes of logs are straight lines through this much time."""
FEWEST = 3
"""Samples of such a line, at least."""
DUTIES = 19
INSTANTS = 200


def distance(left_pct: Array, slope: Array, B_m: float, B_M: float) -> Array:
    """Signed distance of u − η̂(T) [% duty] from B Ṫ over B in [B_m, B_M]; slope in N·m/s, shapes alike."""
    low, high = np.minimum(B_m * slope, B_M * slope), np.maximum(B_m * slope, B_M * slope)
    return np.maximum(left_pct - high, 0.0) + np.minimum(left_pct - low, 0.0)


def shown_by_model(plant: Nonlinear, model: Linear, B_m: float, B_M: float, unit: str = "%") -> Mismatch:
    """Over the nonlinear model's steps between identified duties and from rest."""
    duties = np.linspace(*plant.u_range, DUTIES)
    tau1, tau2 = time_constants(plant, duties)
    steady = steady_torque(plant, duties)
    shown = []
    for duty, fast, slow, end in zip(duties, tau1, tau2, steady, strict=True):
        t = np.concatenate([[0.0], np.geomspace(1e-3, 5 * slow, INSTANTS)])
        first, second = np.exp(-t / fast), np.exp(-t / slow)
        start = np.concatenate([[0.0], steady])[:, None]
        torque = end + (start - end) * (plant.C * first + (1 - plant.C) * second)
        slope = (end - start) * (plant.C / fast * first + (1 - plant.C) / slow * second)
        found = distance(duty - (model.a0 * torque - model.c0) / model.b0, slope, B_m, B_M)
        i, k = np.unravel_index(np.abs(found).argmax(), found.shape)
        origin = "rest" if i == 0 else f"{duties[i - 1]:.3g} {unit}"
        shown.append((float(found[i, k]), f"{t[k]:.3g} s after a step from {origin} to {duty:.3g} {unit}"))
    return _largest(shown)


def _largest(shown: list[tuple[float, str]]) -> Mismatch:
    """The largest of signed mismatches and where they are; none where nothing is shown."""
    value, where = max(shown, key=lambda each: abs(each[0]), default=(0.0, ""))
    return Mismatch(abs(value), value, where if value else "")


def shown_by_logs(stepset: StepSet, model: Linear, B_m: float, B_M: float) -> Mismatch:
    """Over the averaged rising steps of the logs."""
    shown = []
    for level in stepset.levels:
        t, torque, slope = _smoothed(level.time_s, level.mean)
        found = distance(level.level - (model.a0 * torque - model.c0) / model.b0, slope, B_m, B_M)
        k = int(np.abs(found).argmax())
        shown.append((float(found[k]), f"{t[k]:.3g} s after the step to {level.level:.4g} {stepset.input_unit}"))
    return _largest(shown)


def _smoothed(time_s: Array, torque_nm: Array) -> tuple[Array, Array, Array]:
    """Time, torque and slope of straight lines through successive windows, shapes (windows,)."""
    edges = np.searchsorted(time_s, np.arange(time_s[0], time_s[-1], WINDOW_S))
    edges = np.append(edges, len(time_s))
    held = np.diff(edges)
    if np.median(held[held > 0]) < FEWEST:  # sampled too slowly for that: as few as tell a slope
        edges = np.append(np.arange(0, len(time_s), FEWEST), len(time_s))
    rows = []
    for begin, end in itertools.pairwise(edges.tolist()):
        if end - begin < FEWEST:
            continue
        t, y = time_s[begin:end], torque_nm[begin:end]
        centred = t - t.mean()
        rows.append((t.mean(), y.mean(), float(centred @ y / (centred @ centred))))
    table = np.array(rows).reshape(-1, 3)
    return table[:, 0], table[:, 1], table[:, 2]


def shown_by_levels(per_level: Sequence[LevelB], model: Linear, torque_max_nm: float, unit: str = "%") -> Mismatch:
    """Over the single levels' first-order models from 0 to a torque [N·m]; linear in T, so one end is the worst."""
    shown = []
    for row, torque in itertools.product(per_level, (0.0, torque_max_nm)):
        eta = row.a0 * torque * row.B
        where = f"at an output of {torque:.3g} on the model of {row.level:.4g} {unit} alone"
        shown.append((eta - (model.a0 * torque - model.c0) / model.b0, where))
    return _largest(shown)
