"""The replay against python-control and NumPy over plants."""

import dataclasses
from collections.abc import Callable, Iterator
from functools import partial
from time import process_time
from typing import Any

import numpy as np

from benchmarks.table import Row, paired_medians
from eaid.control.rc import RCGains, rc_step
from eaid.options import RigExtras
from eaid.plant.dynamics import REFERENCE_PLANT, Plant, PlantNumbers, plant_numbers
from eaid.replay.controllers import controller_of, feedback
from eaid.replay.loop import reference_rate, replay, sensor_noise
from eaid.replay.many import montecarlo
from eaid.replay.references import multisine

DT_S = 1e-3
SINGLE_S = 60.0
PLANTS = 1000
MANY_S = 10.0
RUNS = 9
GAINS = RCGains(4.5, 3.0, 12.5, 1.36, 0.08, -2.42, 10.8125, 6.58594648300479, 0.5, 50.0, 5 / 9, 55 / 54)
"""Table IV."""
RC = feedback(GAINS)
RIG = RigExtras(noise_nm=0.01)


class Case:
    """A reference with its slope and noise."""

    def __init__(self, duration_s: float) -> None:
        self.wanted = multisine(DT_S, duration_s, 1.0, 1.0)
        self.reference = np.array(self.wanted.torque_nm)
        self.rate = reference_rate(self.reference, DT_S, False)
        self.n = len(self.reference)
        self.noise = sensor_noise(RIG, self.n, 1)


def drawn_plants() -> list[Plant]:
    """Plants whose time constants stay well inside their range, as a fit's uncertainty would draw them."""
    random = np.random.default_rng(5)
    plants = []
    for _ in range(PLANTS):
        s, f, t = 1 + 0.03 * random.standard_normal(3)
        plants.append(
            dataclasses.replace(
                REFERENCE_PLANT,
                tau1=tuple(f * c for c in REFERENCE_PLANT.tau1),
                tau2=tuple(t * c for c in REFERENCE_PLANT.tau2),
                Ts=tuple(s * c for c in REFERENCE_PLANT.Ts),
            )
        )
    return plants


def numpy_many(case: Case, plants: list[PlantNumbers]) -> np.ndarray:
    """The loop with NumPy over the plants: what one writes first."""
    C, tau1, tau2, steady, low, high = (np.array(column).T for column in list(zip(*plants, strict=True))[:6])
    (a0, a1, a2), (b0, b1, b2), (c0, c1, c2, c3) = tau1, tau2, steady
    g = GAINS
    x1, x2, q = (np.zeros(len(plants)) for _ in range(3))
    torque = np.empty((case.n, len(plants)))
    for k in range(case.n):
        torque[k] = x1 + x2
        seen = torque[k] + case.noise[k]
        e = case.reference[k] - seen
        z = g.Q12 * q + g.Q22 * e
        rho = g.rho_constant + g.rho_slope * np.sqrt(q * q + e * e)
        share = (np.tanh(g.gamma * (np.abs(z) - g.epsilon)) + 1) / 2
        omega = share * np.copysign(rho, z) + (1 - share) * rho * z / g.epsilon
        wanted = g.B_hat * (case.rate[k] + g.K_D * e + g.K_P * q + omega) + (g.a0 * seen - g.c0) / g.b0
        u = np.clip(wanted, 0.0, 100.0)
        q = np.where((wanted - u) * e > 0, q, q + DT_S * e)
        below = np.where(u < low, u / low, 1.0)
        u = np.clip(u, low, high)
        t1 = np.maximum(a0 + u * (a1 + u * a2), 1e-3)
        t2 = np.maximum(b0 + u * (b1 + u * b2), t1)
        s = np.maximum(below * (c0 + u * (c1 + u * (c2 + u * c3))), 0.0)
        x1 = x1 - np.expm1(-DT_S / t1) * (C * s - x1)
        x2 = x2 - np.expm1(-DT_S / t2) * (s - C * s - x2)
    return torque


def python_control(case: Case, plant: PlantNumbers) -> Callable[[], np.ndarray]:
    """The same maths in python-control: plant and controller as discrete-time systems, connected."""
    import control

    from eaid.plant.dynamics import plant_step

    def plant_update(_t: float, x: Any, u: Any, _p: Any) -> Any:
        return plant_step(plant, x[0], x[1], u[0], DT_S)

    def law(x: Any, u: Any) -> tuple[float, float]:
        return rc_step(GAINS, float(x[0]), float(u[0]), float(u[1]), float(u[2] + u[3]), DT_S)

    clutch = control.nlsys(
        plant_update, lambda _t, x, _u, _p: x[0] + x[1], inputs=["u"], outputs=["T"], states=2, dt=DT_S, name="clutch"
    )
    robust = control.nlsys(
        lambda _t, x, u, _p: law(x, u)[0],
        lambda _t, x, u, _p: law(x, u)[1],
        inputs=["r", "v", "d", "T"],
        outputs=["u"],
        states=1,
        dt=DT_S,
        name="robust",
    )
    closed = control.interconnect(
        [clutch, robust],
        connections=[["clutch.u", "robust.u"], ["robust.T", "clutch.T"]],
        inplist=["robust.r", "robust.v", "robust.d"],
        outlist=["clutch.T"],
        dt=DT_S,
    )
    time_s = np.arange(case.n) * DT_S
    inputs = np.vstack([case.reference, case.rate, case.noise])
    return lambda: np.asarray(control.input_output_response(closed, time_s, inputs, np.zeros(3)).outputs)


def rows() -> Iterator[Row]:
    plant, long = plant_numbers(REFERENCE_PLANT), Case(SINGLE_S)
    ours = partial(replay, plant, RC, long.reference, RIG, DT_S, 1)
    theirs = python_control(long, plant)
    our_s, control_s = paired_medians(ours, theirs, min(RUNS, 3))
    agree = float(np.abs(ours()["torque_nm"] - theirs()).max())
    yield Row(
        "one 60 s replay", "plain Python", our_s, "python-control", control_s, "≥ 20 × faster",
        control_s >= 20 * our_s, f"{agree:.1e} N·m apart",
    )  # fmt: skip
    inverse = controller_of("inverse", REFERENCE_PLANT, None, None, (0.0, 100.0))
    our_s, rc_s = paired_medians(
        partial(replay, plant, inverse, long.reference, RIG, DT_S, 1), ours, RUNS, process_time
    )
    yield Row(
        "a sample under the inverse", "inverse", our_s / long.n, "rc", rc_s / long.n, "below 1 % of a 1 ms sample",
        our_s / long.n <= 1e-5,
    )  # fmt: skip
    short, plants = Case(MANY_S), drawn_plants()
    many = partial(montecarlo, plants, RC, short.wanted, RIG, 1)
    by_numpy = partial(numpy_many, short, [plant_numbers(each) for each in plants])
    our_s, numpy_s = paired_medians(many, by_numpy, min(RUNS, 3))
    largest = np.abs(by_numpy() - short.reference[:, None])[short.wanted.begin :].max(axis=0)
    agree = float(np.abs(largest - many()[1]["plants/metrics/max_abs_error_nm"]).max())
    yield Row(
        f"{PLANTS} plants × 10 s", "numba, a plant a thread", our_s, "NumPy over the plants", numpy_s, "≥ 1.2 × faster",
        numpy_s >= 1.2 * our_s, f"{agree:.1e} N·m apart",
    )  # fmt: skip
