"""The replay against C compiled in the same run, python-control, NumPy over plants, and a long-double reference."""

import ctypes
import dataclasses
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.table import Row, paired_medians, process
from eaid.control.gains import paper_gains
from eaid.control.rc import RCGains, RCState, rc_step
from eaid.models.parameters import REFERENCE_PLANT
from eaid.replay.compiled import loop_alone
from eaid.replay.controllers import Knowledge, controller, rc_controller
from eaid.replay.lanes import LANES, telescoped
from eaid.replay.loop import Inputs, reference_rate, replay
from eaid.replay.many import available_threads, replay_many
from eaid.replay.plant import PlantParameters, plant_parameters
from eaid.replay.references import multisine
from eaid.replay.rig import Rig, noise, rig_numbers

DT_S = 1e-3
SINGLE_S = 60.0
PLANTS = 1000
MANY_S = 10.0
FLAGS = ("-O3", "-march=native", "-shared", "-fPIC", "-lm")
SOURCE = Path(__file__).parent / "replay.c"
GAINS = RCGains(*(float(value) for value in paper_gains()[0]))
RC = rc_controller(GAINS)
RIG = Rig(noise_nm=0.01)
IMPORTED = """
import sys
from eaid.cli import main
main.run(sys.argv[1:])
print(*sys.modules, file=sys.stderr)
"""
"""Runs a command and tells every module that it has loaded, in the order of loading."""


def compiled_c(folder: Path, name: str, *flags: str) -> ctypes.CDLL:
    """replay.c as a library."""
    path = folder / f"{name}.so"
    subprocess.run(["gcc", str(SOURCE), "-o", str(path), *flags, *FLAGS], check=True)
    return ctypes.CDLL(str(path))


def pointer(values: np.ndarray) -> Any:
    return values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


class Case:
    """A reference with its slope and noise, as C and Python take it."""

    def __init__(self, duration_s: float) -> None:
        self.reference = np.array(multisine(DT_S, duration_s).torque_nm)
        self.rate = reference_rate(self.reference, DT_S, False)
        self.n = len(self.reference)
        self.noise = noise(RIG, self.n, DT_S, 1)
        self.torque, *self.others = (np.empty(self.n) for _ in range(6))

    def c_arguments(self) -> tuple[Any, ...]:
        return pointer(self.reference), pointer(self.rate), pointer(self.noise)


def c_single(library: ctypes.CDLL, case: Case, plant: PlantParameters) -> Callable[[], None]:
    gains, parameters = np.array(GAINS[:14]), np.array(plant)
    torque, duty = np.empty(case.n), np.empty(case.n)
    case_arguments = case.c_arguments()

    def run() -> None:
        library.replay_one(
            ctypes.c_long(case.n),
            pointer(gains),
            pointer(parameters),
            ctypes.c_double(DT_S),
            *case_arguments,
            pointer(torque),
            pointer(duty),
        )

    run.torque = torque  # type: ignore[attr-defined]
    return run


def our_single(case: Case, plant: PlantParameters) -> Callable[[], None]:
    run = loop_alone(rc_step)
    numbers, ones = rig_numbers(RIG, DT_S), np.ones(case.n)
    filled = (case.torque, *case.others)
    inputs = Inputs(case.reference, case.rate, case.noise, ones)
    return lambda: run(GAINS, RCState(), plant, numbers, DT_S, inputs, filled)  # type: ignore[return-value]


def drawn_plants() -> list[PlantParameters]:
    """Plants whose time constants stay well inside their range, as a fit's uncertainty would draw them."""
    random = np.random.default_rng(5)
    plants = []
    for _ in range(PLANTS):
        s, f, t = 1 + 0.03 * random.standard_normal(3)
        plants.append(
            plant_parameters(
                dataclasses.replace(
                    REFERENCE_PLANT,
                    tau1=tuple(f * c for c in REFERENCE_PLANT.tau1),
                    tau2=tuple(t * c for c in REFERENCE_PLANT.tau2),
                    Ts=tuple(s * c for c in REFERENCE_PLANT.Ts),
                )
            )
        )
    return plants


def c_many(library: ctypes.CDLL, case: Case, plants: list[PlantParameters], threads: int) -> Callable[[], None]:
    lanes = -(-len(plants) // LANES) * LANES
    padded = np.ascontiguousarray(np.array([*plants, *[plants[-1]] * (lanes - len(plants))]).T)
    gains, series = np.array(GAINS[:14]), np.array(telescoped(13))
    torque, duty = (np.empty((threads, case.n, LANES)) for _ in range(2))
    case_arguments = case.c_arguments()

    def run() -> None:
        library.replay_many(
            ctypes.c_long(case.n),
            ctypes.c_long(lanes),
            pointer(gains),
            pointer(padded),
            ctypes.c_double(DT_S),
            *case_arguments,
            pointer(series),
            pointer(torque),
            pointer(duty),
            ctypes.c_int(threads),
        )

    return run


def numpy_many(case: Case, plants: list[PlantParameters]) -> np.ndarray:
    """The loop with NumPy over the plants: what one writes first."""
    C, a0, a1, a2, b0, b1, b2, c0, c1, c2, c3, low, high, _, _, _ = np.array(plants).T
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


def python_control(case: Case, plant: PlantParameters) -> Callable[[], np.ndarray]:
    """The same maths in python-control: plant and controller as discrete-time systems, connected."""
    import control

    from eaid.replay.plant import plant_step

    def plant_update(_t: float, x: Any, u: Any, _p: Any) -> Any:
        return plant_step(plant, x[0], x[1], u[0], DT_S)

    def law(x: Any, u: Any) -> tuple[float, float]:
        state, duty = rc_step(GAINS, RCState(float(x[0])), float(u[0]), float(u[1]), float(u[2] + u[3]), DT_S)
        return state.integral, duty

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


def many_of_ours(case: Case, plants: list[PlantParameters], threads: int) -> Callable[[], None]:
    return lambda: replay_many(plants, RC, case.reference, RIG, DT_S, lambda _i, _t, _u: None, 1, threads)


def rows() -> Iterator[Row]:
    plant = plant_parameters(REFERENCE_PLANT)
    threads = available_threads()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plain_c = compiled_c(folder, "plain")
        simd_c = compiled_c(folder, "simd", "-fopenmp", "-ffast-math")
        exact_c = compiled_c(folder, "exact", "-DREAL=long double")

        long = Case(SINGLE_S)
        ours, c = our_single(long, plant), c_single(plain_c, long, plant)
        our_s, c_s = paired_medians(ours, c, 31)
        reference = c_single(exact_c, long, plant)
        reference()
        away = float(np.abs(long.torque - reference.torque).max())  # type: ignore[attr-defined]
        yield Row(
            "one 60 s replay",
            "numba, warm",
            our_s,
            "C -O3",
            c_s,
            "≤ 1.2 × the time",
            our_s <= 1.2 * c_s,
            f"{away:.1e} N·m from long double",
        )
        plain_s = processor_seconds(lambda: replay(plant, RC, long.reference, RIG, DT_S, 1))
        yield Row(
            "one 60 s replay, no compile wait",
            "plain Python",
            plain_s,
            "numba from its cache, imports included",
            compiled_from_cold(),
            "about 0.1 s of processor time",
            plain_s <= 0.15,
        )
        yield from _inverse(long, plant)
        theirs = python_control(long, plant)
        our_s, control_s = paired_medians(ours, theirs, 3)
        agree = float(np.abs(long.torque - theirs()).max())
        yield Row(
            "against python-control",
            "numba, warm",
            our_s,
            "input_output_response",
            control_s,
            "≥ 1,000 × faster",
            control_s >= 1000 * our_s,
            f"{agree:.1e} N·m apart",
        )

        short, plants = Case(MANY_S), drawn_plants()
        ours, c = many_of_ours(short, plants, threads), c_many(simd_c, short, plants, threads)
        our_s, c_s = paired_medians(ours, c, 15)
        kept = np.empty((PLANTS, short.n))

        def keep(first: int, torque: np.ndarray, _duty: np.ndarray) -> None:
            kept[first : first + torque.shape[1]] = torque.T

        replay_many(plants, RC, short.reference, RIG, DT_S, keep, 1, threads)
        away = 0.0
        for i in range(0, PLANTS, 50):
            exact = c_single(exact_c, short, plants[i])
            exact()
            away = max(away, float(np.abs(kept[i] - exact.torque).max()))  # type: ignore[attr-defined]
        yield Row(
            f"{PLANTS} plants × 10 s",
            f"blocks of 16, {threads} threads",
            our_s,
            "C, SIMD and OpenMP",
            c_s,
            "≤ 3 × the time",
            our_s <= 3 * c_s,
            f"{away:.1e} N·m from long double",
        )
        our_s, numpy_s = paired_medians(ours, lambda: numpy_many(short, plants), 3)
        agree = float(np.abs(numpy_many(short, plants).T - kept).max())
        yield Row(
            f"{PLANTS} plants × 10 s",
            f"blocks of 16, {threads} threads",
            our_s,
            "NumPy over the plants",
            numpy_s,
            "≥ 15 × faster",
            numpy_s >= 15 * our_s,
            f"{agree:.1e} N·m apart",
        )
        yield _cold(folder)


def processor_seconds(call: Callable[[], object]) -> float:
    """Processor time of a call [s], median of five: what other work on the machine does not move."""
    taken = []
    for _ in range(5):
        start = time.process_time()
        call()
        taken.append(time.process_time() - start)
    return sorted(taken)[2]


def compiled_from_cold() -> float:
    """Importing numba and fetching the compiled loop from its cache, in a process of its own [s of processor time]."""
    code = (
        "import time, numpy, eaid.replay.loop; a = time.process_time(); from benchmarks.replay_speed import *; "
        "our_single(Case(1.0), plant_parameters(REFERENCE_PLANT))(); print(time.process_time() - a)"
    )
    root = Path(__file__).parent.parent
    told = subprocess.run([sys.executable, "-c", code], cwd=root, check=True, capture_output=True, text=True)
    return float(told.stdout)


def _inverse(case: Case, plant: PlantParameters) -> Iterator[Row]:
    """What the inverse of the nonlinear model costs in each sample, against the robust law on the linear one."""
    known = Knowledge(REFERENCE_PLANT, None, *paper_gains())
    inverse = controller("inverse", known)
    rig = Rig()
    plain = [processor_seconds(lambda c=c: replay(plant, c, case.reference, rig, DT_S)) / case.n for c in (inverse, RC)]
    filled = (case.torque, *case.others)
    numbers, zeros, ones = rig_numbers(rig, DT_S), np.zeros(case.n), np.ones(case.n)
    run, ahead = loop_alone(inverse.step), reference_rate(case.reference, DT_S, True)
    law = loop_alone(rc_step)
    compiled = [
        processor_seconds(
            lambda: run(
                inverse.gains, inverse.start, plant, numbers, DT_S, Inputs(case.reference, ahead, zeros, ones), filled
            )
        )
        / case.n,
        processor_seconds(
            lambda: law(GAINS, RC.start, plant, numbers, DT_S, Inputs(case.reference, case.rate, zeros, ones), filled)
        )
        / case.n,
    ]
    for how, (ours, other) in (("plain Python", plain), ("numba", compiled)):
        yield Row(
            f"a sample under the inverse, {how}",
            "inverse",
            ours,
            "rc",
            other,
            "below 1 % of a 1 ms sample",
            ours <= 1e-5,
        )


def _cold(folder: Path) -> Row:
    """A whole `eaid simulate` of two controllers for 12 s, from the Enter key on, against its imports alone."""
    from eaid.results import codec

    p, rc, pi = REFERENCE_PLANT, *paper_gains()
    (folder / "fit.json").write_text(
        codec.text_of(
            codec.stamped(
                "eaid/fit/1",
                {"nonlinear": {"C": p.C, "tau1": p.tau1, "tau2": p.tau2, "Ts": p.Ts, "u_range": p.u_range}},
            )
        ),
        encoding="utf-8",
    )
    model = {"a0": rc.a0, "b0": rc.b0, "c0": rc.c0}
    law = {
        "K_P": rc.K_P,
        "K_D": rc.K_D,
        "B_hat": rc.B_hat,
        "rho": {"constant": rc.rho_constant, "slope": rc.rho_slope},
        "epsilon": rc.epsilon,
        "gamma": rc.gamma,
        "Q": [[1.0, rc.Q12], [rc.Q12, rc.Q22]],
    }
    gains = codec.stamped("eaid/gains/1", {"model": model, "rc": law, "pi": {"K_P": pi.K_P, "K_I": pi.K_I}})
    (folder / "gains.json").write_text(codec.text_of(gains), encoding="utf-8")
    arguments = (
        "simulate",
        "fit.json",
        "--gains",
        "gains.json",
        "--duration",
        "12",
        "-o",
        "replay.h5",
        "--force",
        "-q",
    )
    told = subprocess.run(
        [sys.executable, "-c", IMPORTED, *arguments], cwd=folder, check=True, capture_output=True, text=True
    ).stderr
    (folder / "bare.py").write_text(
        "import importlib\nfor name in " + repr(told.split()) + ":\n"
        "    try:\n        importlib.import_module(name)\n    except ImportError:\n        pass\n"
    )
    ours, bare = paired_medians(
        process(sys.executable, "-m", "eaid", *arguments, cwd=folder), process(sys.executable, "bare.py", cwd=folder), 9
    )
    return Row(
        "a cold simulate, 12 s, rc and pi",
        "eaid simulate",
        ours,
        "its imports alone",
        bare,
        "≤ 1.5 × the time",
        ours <= 1.5 * bare,
    )
