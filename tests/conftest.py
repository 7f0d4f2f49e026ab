"""Fixtures that several rooms' tests share: step sets made from a plant, and files beside the tests."""

import importlib.util
import os
import signal
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from types import ModuleType

# Short kernels: several BLAS threads fight over them and over the machine.
for _name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

# A shell that runs us in the background ignores Ctrl-C, and so would every process that a test starts.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

import numpy as np  # noqa: E402
import pytest  # noqa: E402

from eaid.apparatus import Apparatus  # noqa: E402
from eaid.cli import console  # noqa: E402
from eaid.models import friction, nonlinear  # noqa: E402
from eaid.models.parameters import REFERENCE_PLANT, Friction, Nonlinear  # noqa: E402
from eaid.steps.stepset import Level, StepSet  # noqa: E402

ROOT = Path(__file__).parents[1]


@pytest.fixture(autouse=True)
def _messages_are_told() -> None:
    """One test's `-q` does not hush the next, which runs in the same process."""
    console.be_quiet(False)


def _clutch_set(
    plant: Nonlinear = REFERENCE_PLANT,
    levels: Iterable[float] = range(10, 101, 10),
    duration_s: float = 20.0,
    rate_hz: float = 1000.0,
    noise_nm: float = 0.0,
    repeats: int = 1,
    seed: int = 0,
) -> StepSet:
    rng = np.random.default_rng(seed)
    time_s = np.arange(round(duration_s * rate_hz)) / rate_hz
    made = []
    for u in levels:
        torque = nonlinear.step_response(plant, time_s, float(u))
        runs = torque + noise_nm * rng.normal(size=(repeats, len(time_s)))
        made.append(Level(float(u), time_s, runs, tuple(f"{u}-{r}" for r in range(repeats))))
    return StepSet("clutch", "%", "N·m", Apparatus(), tuple(made))


def _friction_set(
    kind: str, unit: str, curves: dict[float, Friction], duration_s: float = 30.0, rate_hz: float = 100.0
) -> StepSet:
    time_s = np.arange(round(duration_s * rate_hz)) / rate_hz
    levels = tuple(
        Level(u, time_s, friction.step_response(curve, time_s)[None], (f"{u}",)) for u, curve in curves.items()
    )
    return StepSet(kind, unit, "N·m", Apparatus(surfaces=1), levels)


@pytest.fixture(scope="session")
def clutch_set() -> Callable[..., StepSet]:
    """Steps of a plant from rest, white noise on every run; the reference plant, noise-free, unless told otherwise."""
    return _clutch_set


@pytest.fixture(scope="session")
def friction_set() -> Callable[..., StepSet]:
    """Noise-free friction steps, one curve a level."""
    return _friction_set


@pytest.fixture(scope="session")
def fit_quality() -> ModuleType:
    """`benchmarks/fit_quality.py`: random plants, and an independent least-squares multi-start to judge against."""
    spec = importlib.util.spec_from_file_location("fit_quality", ROOT / "benchmarks" / "fit_quality.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules["fit_quality"] = module
    spec.loader.exec_module(module)
    return module
