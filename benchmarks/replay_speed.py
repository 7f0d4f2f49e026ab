"""The replay against C compiled in the same run, python-control, NumPy over plants, and a long-double reference."""

import ctypes
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.table import Row, paired_medians, process
from eaid.control.gains import paper_gains
from eaid.control.rc import RCGains, RCState, rc_step
from eaid.models.parameters import REFERENCE_PLANT
from eaid.replay.compiled import loop_alone
from eaid.replay.controllers import Knowledge, controller, rc_controller
from eaid.replay.loop import Inputs, reference_rate, replay
from eaid.replay.many import available_threads, replay_many
from eaid.replay.plant import PlantParameters, plant_parameters, plant_step
from eaid.replay.references import multisine
from eaid.replay.rig import Rig, noise, rig_numbers

DT_S = 1e-3
SINGLE_S, MANY_S = 60.0, 10.0
PLANTS = 1000
RUNS = 31
FLAGS = ("-O3", "-march=native", "-shared", "-fPIC", "-lm")
SOURCE = Path(__file__).parent / "replay.c"
GAINS = RCGains(*(float(value) for value in paper_gains()[0]))
RC = rc_controller(GAINS)
RIG = Rig(noise_nm=0.01)
PLANT = plant_parameters(REFERENCE_PLANT)
IMPORTED = """
import sys
from eaid.cli import main
main.run(sys.argv[1:])
print(*sys.modules, file=sys.stderr)
"""
"""Runs a command and prints every module that it has loaded, in the order of loading."""


class Case:
    """A reference with its slope and noise, as C and Python take it."""

    def __init__(self, duration_s: float) -> None:
        self.reference = np.array(multisine(DT_S, duration_s).torque_nm)
        self.rate = reference_rate(self.reference, DT_S, False)
        self.n = len(self.reference)
        self.noise = noise(RIG, self.n, DT_S, 1)
        self.torque, *self.others = (np.empty(self.n) for _ in range(6))


def c_loop(folder: Path, name: str, case: Case, *flags: str) -> tuple[Callable[[PlantParameters], None], np.ndarray]:
    """replay.c, compiled, as a call for one plant, and the torque that it fills."""
    path = folder / f"{name}.so"
    subprocess.run(["gcc", str(SOURCE), "-o", str(path), *flags, *FLAGS], check=True)
    library = ctypes.CDLL(str(path))

    def pointer(values: np.ndarray) -> Any:
        return values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))

    gains, torque, duty = np.array(GAINS[:14]), np.empty(case.n), np.empty(case.n)
    given = [pointer(values) for values in (case.reference, case.rate, case.noise, torque, duty)]

    def run(plant: PlantParameters) -> None:
        parameters = np.array(plant)
        library.replay_one(
            ctypes.c_long(case.n), pointer(gains), pointer(parameters), ctypes.c_double(DT_S), *given
        )  # fmt: skip

    return run, torque


def our_single(case: Case) -> Callable[[], object]:
    run, numbers = loop_alone(rc_step), rig_numbers(RIG, DT_S)
    inputs = Inputs(case.reference, case.rate, case.noise, np.ones(case.n))
    return lambda: run(GAINS, RCState(), PLANT, numbers, DT_S, inputs, (case.torque, *case.others))


def drawn_plants() -> list[PlantParameters]:
    """Plants whose time constants stay well inside their range, as a fit's uncertainty would draw them."""
    p = REFERENCE_PLANT
    return [
        plant_parameters(
            replace(
                p, tau1=tuple(f * c for c in p.tau1), tau2=tuple(t * c for c in p.tau2), Ts=tuple(s * c for c in p.Ts)
            )
        )
        for s, f, t in (1 + 0.03 * np.random.default_rng(5).standard_normal((PLANTS, 3))).tolist()
    ]


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


def python_control(case: Case) -> Callable[[], np.ndarray]:
    """The same maths in python-control: plant and controller as discrete-time systems, connected."""
    import control

    def law(x: Any, u: Any) -> tuple[float, float]:
        state, duty = rc_step(GAINS, RCState(float(x[0])), float(u[0]), float(u[1]), float(u[2] + u[3]), DT_S)
        return state.integral, duty

    clutch = control.nlsys(
        lambda _t, x, u, _p: plant_step(PLANT, x[0], x[1], u[0], DT_S), lambda _t, x, _u, _p: x[0] + x[1],
        inputs=["u"], outputs=["T"], states=2, dt=DT_S, name="clutch",
    )  # fmt: skip
    robust = control.nlsys(
        lambda _t, x, u, _p: law(x, u)[0], lambda _t, x, u, _p: law(x, u)[1],
        inputs=["r", "v", "d", "T"], outputs=["u"], states=1, dt=DT_S, name="robust",
    )  # fmt: skip
    closed = control.interconnect(
        [clutch, robust], connections=[["clutch.u", "robust.u"], ["robust.T", "clutch.T"]],
        inplist=["robust.r", "robust.v", "robust.d"], outlist=["clutch.T"], dt=DT_S,
    )  # fmt: skip
    time_s = np.arange(case.n) * DT_S
    inputs = np.vstack([case.reference, case.rate, case.noise])
    return lambda: np.asarray(control.input_output_response(closed, time_s, inputs, np.zeros(3)).outputs)


def rows() -> Iterator[Row]:
    with tempfile.TemporaryDirectory() as name:
        folder, long, short = Path(name), Case(SINGLE_S), Case(MANY_S)
        ours, (c, _), (exact, exactly) = our_single(long), c_loop(folder, "plain", long), c_loop(
            folder, "exact", long, "-DREAL=long double"
        )  # fmt: skip
        our_s, c_s = paired_medians(ours, lambda: c(PLANT), RUNS)
        exact(PLANT)
        away = f"{np.abs(long.torque - exactly).max():.1e} N·m from long double"
        yield Row("one 60 s replay", "numba, warm", our_s, "C -O3", c_s, "≤ 1.2 × the time", our_s <= 1.2 * c_s, away)
        plain_s = processor_seconds(lambda: replay(PLANT, RC, long.reference, RIG, DT_S, 1))
        yield Row(
            "one 60 s replay, no compile wait", "plain Python", plain_s, "numba from its cache, imports included",
            compiled_from_cold(), "about 0.1 s of processor time", plain_s <= 0.15,
        )  # fmt: skip
        yield from inverse(long)
        theirs = python_control(long)
        our_s, control_s = paired_medians(ours, theirs, 3)
        yield Row(
            "against python-control", "numba, warm", our_s, "input_output_response", control_s, "≥ 1,000 × faster",
            control_s >= 1000 * our_s, f"{np.abs(long.torque - theirs()).max():.1e} N·m apart",
        )  # fmt: skip

        plants, kept = drawn_plants(), np.empty((PLANTS, short.n))

        def keep(first: int, torque: np.ndarray, _duty: np.ndarray) -> None:
            kept[first : first + torque.shape[1]] = torque.T

        our_s, numpy_s = paired_medians(
            lambda: replay_many(plants, RC, short.reference, RIG, DT_S, keep, 1), lambda: numpy_many(short, plants), 3
        )
        (exact, exactly), away = c_loop(folder, "exact-short", short, "-DREAL=long double"), 0.0
        for i in range(0, PLANTS, 50):
            exact(plants[i])
            away = max(away, float(np.abs(kept[i] - exactly).max()))
        yield Row(
            f"{PLANTS} plants × {MANY_S:g} s", f"blocks of 16, {available_threads()} threads", our_s,
            "NumPy over the plants", numpy_s, "≥ 15 × faster", numpy_s >= 15 * our_s,
            f"{away:.1e} N·m from long double",
        )  # fmt: skip
        yield cold(folder)


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
        "our_single(Case(1.0))(); print(time.process_time() - a)"
    )
    root = Path(__file__).parent.parent
    told = subprocess.run([sys.executable, "-c", code], cwd=root, check=True, capture_output=True, text=True)
    return float(told.stdout)


def inverse(case: Case) -> Iterator[Row]:
    """What the inverse of the nonlinear model costs in each sample, against the robust law on the linear one."""
    laws = (controller("inverse", Knowledge(REFERENCE_PLANT, None, *paper_gains())), RC)
    numbers, zeros, ones = rig_numbers(Rig(), DT_S), np.zeros(case.n), np.ones(case.n)

    def compiled(law: Any) -> Callable[[], object]:
        run, rate = loop_alone(law.step), reference_rate(case.reference, DT_S, law.looks_ahead)
        inputs = Inputs(case.reference, rate, zeros, ones)
        return lambda: run(law.gains, law.start, PLANT, numbers, DT_S, inputs, (case.torque, *case.others))

    for how, call in (
        ("plain Python", lambda law: lambda: replay(PLANT, law, case.reference, Rig(), DT_S)),
        ("numba", compiled),
    ):
        ours, other = (processor_seconds(call(law)) / case.n for law in laws)
        yield Row(
            f"a sample under the inverse, {how}", "inverse", ours, "rc", other, "below 1 % of 1 ms", ours <= 1e-5
        )  # fmt: skip


def cold(folder: Path) -> Row:
    """A whole `eaid simulate` of two controllers for 12 s, from the Enter key on, against its imports alone."""
    p, rc, pi = REFERENCE_PLANT, *paper_gains()
    plant = {"C": p.C, "tau1": p.tau1, "tau2": p.tau2, "Ts": p.Ts, "u_range": p.u_range}
    law = {
        "K_P": rc.K_P, "K_D": rc.K_D, "B_hat": rc.B_hat, "rho": {"constant": rc.rho_constant, "slope": rc.rho_slope},
        "epsilon": rc.epsilon, "gamma": rc.gamma, "Q": [[1.0, rc.Q12], [rc.Q12, rc.Q22]],
    }  # fmt: skip
    model = {"a0": rc.a0, "b0": rc.b0, "c0": rc.c0}
    gains = {"model": model, "rc": law, "pi": {"K_P": pi.K_P, "K_I": pi.K_I}}
    for name, content in (("fit.json", {"nonlinear": plant}), ("gains.json", gains)):
        (folder / name).write_text(json.dumps(content), encoding="utf-8")
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
        f"import importlib\nfor name in {told.split()!r}:\n"
        "    try:\n        importlib.import_module(name)\n    except ImportError:\n        pass\n"
    )
    ours, bare = paired_medians(
        process(sys.executable, "-m", "eaid", *arguments, cwd=folder),
        process(sys.executable, "bare.py", cwd=folder),
        max(1, RUNS // 3),
    )
    return Row(
        "a cold simulate, 12 s, rc and pi", "eaid simulate", ours, "its imports alone", bare, "≤ 1.5 × the time",
        ours <= 1.5 * bare,
    )  # fmt: skip
