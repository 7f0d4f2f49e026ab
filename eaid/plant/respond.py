"""What a plant answers to a held input, exactly: each state goes to its end as `eaid.plant.dynamics` has it."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from eaid.arrays import Array
from eaid.plant.dynamics import Plant, PlantNumbers, plant_numbers, plant_pull, plant_step, plant_terms, swing
from eaid.plant.steps import decay, rise, step_rate, step_response

FEW_ROWS_HELD = 8  # An input held for fewer rows is followed row by row, which then is faster
# (input, whether it was fallen to) → the plant that acts while it is held
Acting = Callable[[float, bool], PlantNumbers]


def respond(
    plant: Plant,
    changes_s: Sequence[float] | Array,
    inputs: Sequence[float] | Array,
    time_s: Array,
    start: tuple[float, float] = (0.0, 0.0),
    stepwise: bool = True,
) -> Array:
    """Output of a plant above idle at the instants `time_s`, shape (n,), its dead time and what falls have included.

    Parameters
    ----------
    plant : Plant
        In the rig's units.
    changes_s, inputs : shape (m,)
        The input is `inputs[k]` from `changes_s[k]` on [s]; the first held before, too.
    time_s : shape (n,)
        Instants [s], rising, from the first change on.
    start : tuple of two floats
        States at the first instant; 0 at rest.
    stepwise : bool
        Whether a held input that the log fell to has the plant's `excess`.
    """
    begins, values = np.array(changes_s, dtype=np.float64) + plant.dead_time_s, np.asarray(inputs, dtype=np.float64)
    begins[0] = min(begins[0], time_s[0])
    plant = plant if stepwise else replace(plant, release_as_left=False)
    numbers = plant_numbers(plant)
    raised = plant_numbers(plant.scaled(1 + plant.excess))
    return driven(lambda _, fell: raised if fell and stepwise else numbers, begins, values, time_s, start)


def driven(
    acting: Acting, begins: Array, values: Array, time_s: Array, start: tuple[float, float] = (0.0, 0.0)
) -> Array:
    """Output at the instants `time_s`, shape (n,), under an input that acts as `values[k]` from `begins[k]` on.

    The instants rise, from the first change on; the states begin at `start`.
    """
    first = np.append(0, np.flatnonzero(np.diff(values)) + 1)
    begins, values = begins[first], values[first]
    fell = np.append(False, (values[1:] < values[:-1]) & (values[1:] > 0))
    rows = np.append(np.searchsorted(time_s, begins), len(time_s)).tolist()
    ends = np.append(begins[1:], max(float(time_s[-1]), float(begins[-1])))
    output, (x1, x2) = np.empty(len(time_s)), start
    left = np.append(0.0, values[:-1]).tolist()
    held = zip(begins.tolist(), ends.tolist(), values.tolist(), fell.tolist(), strict=True)
    for k, (begin, end, value, fallen) in enumerate(held):
        plant, part = acting(value, fallen), slice(rows[k], rows[k + 1])
        plant = at_rest(plant, left[k]) if value == 0.0 else plant
        since = time_s[part] - begin
        if rows[k + 1] - rows[k] < FEW_ROWS_HELD or plant.zeta >= 0.0:
            states = [plant_step(plant, x1, x2, value, dt) for dt in since.tolist()]
            output[part] = [one + plant.z * two for one, two in states]
        else:
            fast, slow, tau1, tau2 = plant_pull(plant, x1, x2, value)
            output[part] = x1 + rise(since, tau1) * fast + x2 + rise(since, tau2) * slow
        x1, x2 = plant_step(plant, x1, x2, value, end - begin)
    return output


def at_rest(plant: PlantNumbers, left: float) -> PlantNumbers:
    """The plant at rest behind a held input."""
    return plant._replace(release=plant_terms(plant, left)[:2]) if plant.release_as_left else plant


def left_of_start(plant: PlantNumbers, u: float, t_s: Array, falls: tuple[bool, bool] = (False, False)) -> Array:
    """What each state at the start still makes of the output after t seconds of a held input, (2, n).

    `falls`: whether each part lies above its target, and goes down as falls do.
    """
    if plant.zeta >= 0.0:
        flows = np.array([swing(plant.zeta, dt / plant_terms(plant, u)[0]) for dt in t_s.tolist()]).reshape(-1, 2)
        c, n = flows.T
        return np.stack([c + plant.zeta * n - plant.z * n, n + plant.z * (c - plant.zeta * n)])
    above1, above2 = (np.inf if one else -np.inf for one in falls)
    above = plant_pull(plant, above1, above2, u)[2:]
    return np.stack([decay(t_s, tau) for tau in above])


def unit_step(plant: Plant, t_s: Array, u: float) -> tuple[Array, Array]:
    """How far a step to an input has gone, 1 in the end, at times since it acts [s], and how fast it goes [1/s]."""
    if plant.zeta is None:
        at = replace(plant.at(u), Ts=1.0)
        return step_response(at, t_s), step_rate(at, t_s)
    tau, zeta, z = plant_terms(plant_numbers(plant), u)[0], plant.zeta, plant.zero
    c, n = np.array([swing(zeta, dt / tau) for dt in np.ravel(t_s).tolist()]).T
    away = c + zeta * n  # of the first state from its end; n is the second
    return 1 - away + z * n, (n + z * (away - 2 * zeta * n)) / tau


def from_rest(plant: Plant, t_s: Array, u: float) -> Array:
    """Output above idle at times since a step from rest to an input [s], behind its dead time, shape of `t_s`."""
    after = np.maximum(t_s - plant.dead_time_s, 0.0)
    if plant.zeta is None:
        return step_response(plant.at(u), after)
    return np.asarray(plant.steady(u) * unit_step(plant, after, u)[0])
