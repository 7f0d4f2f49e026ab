"""Fixtures that several rooms' tests share: the command line in this process, data sets and results made once."""

import json
import os
import pickle
import runpy
import signal
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar

# Short kernels: several BLAS threads fight over them and over the machine.
for _name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

# A shell that runs us in the background ignores Ctrl-C, and so would every process that a test starts.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

import numpy as np  # noqa: E402
import pytest  # noqa: E402
from hypothesis import HealthCheck, settings  # noqa: E402

import eaid  # noqa: E402
from eaid.apparatus import Apparatus  # noqa: E402
from eaid.cli import main  # noqa: E402
from eaid.plant.dynamics import REFERENCE_PLANT, Plant, Step  # noqa: E402
from eaid.plant.respond import from_rest  # noqa: E402
from eaid.plant.steps import step_response  # noqa: E402
from eaid.steps.stepset import Level, StepSet  # noqa: E402

ROOT = Path(__file__).parents[1]
Made = TypeVar("Made", bound=Callable[..., Any])
settings.register_profile("loaded", suppress_health_check=[HealthCheck.too_slow], deadline=None)
settings.load_profile("loaded")  # another program on the machine is no failure
PLANT: dict[str, Any] = {
    "C": 0.85, "tau1": [6.74e-3, 2.39e-2, -2.13e-4], "tau2": [0.93, 0.41, -2.64e-3],
    "Ts": [0.032, 9.2e-3, 2.1e-4, 1.32e-6], "u_range": [10.0, 100.0],
}  # fmt: skip
LINEAR: dict[str, Any] = {"a0": 1.36, "b0": 0.08, "c0": -2.42, "bounds": {"B_m": 12.4, "B_M": 42.6}}
GAINS: dict[str, Any] = {
    "schema": "eaid/gains/1",
    "model": {"a0": 1.36, "b0": 0.08, "c0": -2.42},
    "rc": {
        "K_P": 4.5, "K_D": 3.0, "B_hat": 12.5, "epsilon": 0.5, "gamma": 50.0, "Q_M": 5.0,
        "rho": {"constant": 10.8125, "slope": 6.58594648300479}, "Q": [[1.0, 5 / 9], [5 / 9, 55 / 54]],
    },
    "pi": {"K_P": 21.0, "K_I": 360.0},
}  # fmt: skip
"""The reference plant, the paper's linear model and its gains, as a script writes them into fit.json and gains.json."""


def codes(result: Any) -> dict[str, Any]:
    """Findings of a result by code."""
    return {one.code: one for one in result.findings}


def made_once(make: Made) -> Made:
    """A function that makes a thing of the same arguments once: results do not change."""
    held: dict[bytes, Any] = {}

    @wraps(make)
    def kept(*given: Any, **named: Any) -> Any:
        key = pickle.dumps((given, sorted(named.items())))
        if key not in held:
            held[key] = make(*given, **named)
        return held[key]

    return kept  # type: ignore[return-value]


def loaded(plain: dict[str, Any]) -> Any:
    """The result of a file that a script wrote; what is None is left out."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "result.json"
        path.write_text(json.dumps({key: part for key, part in plain.items() if part is not None}), encoding="utf-8")
        return eaid.load(path)


def pytest_sessionstart(session: pytest.Session) -> None:
    """Before several processes begin, one compiles what each of them would."""
    if session.config.getoption("numprocesses", None) and not hasattr(session.config, "workerinput"):
        t, u = np.arange(400) * 0.05, np.repeat([0.0, 1.0, 3.0, 0.0, 2.0], 80)
        log = {"time_s": t, "input_V": u, "output_N": np.convolve(u, np.full(20, 0.05))[:400] + 0.01 * np.sin(99 * t)}
        eaid.fit(eaid.read(log, logs_as="recorded"), ci="none")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Tests of a room with data sets of its own go to one process, the others file by file."""
    from xdist.scheduler import LoadScopeScheduling

    class ByRoom(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            path = ROOT / nodeid.partition("::")[0]
            shares = (path.parent / "conftest.py").exists() and path.parent != ROOT / "tests"
            return str(path.parent if shares else path)

    return ByRoom(config, log)


@dataclass(frozen=True)
class Ran:
    """What one command gave back."""

    code: int
    out: str
    err: str


@pytest.fixture
def run_eaid(capsys: pytest.CaptureFixture[str]) -> Callable[..., Ran]:
    """`run_eaid("fit", path, "-o", out)`: the command in this process, with its exit code and what it printed."""

    def run(*words: object) -> Ran:
        capsys.readouterr()
        code = main.run([str(word) for word in words])
        return Ran(code, *capsys.readouterr())

    return run


@pytest.fixture(scope="session")
def rigs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Logs as other rigs record them."""
    made: Path = runpy.run_path(str(ROOT / "tests/frozen/rigs.py"))["write"](tmp_path_factory.mktemp("rigs"))
    return made


@pytest.fixture(scope="session")
def small_steps() -> "eaid.StepSet":
    """Three levels × two runs of the reference plant with the usual noise and scatter, 50 Hz."""
    return eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1)


@pytest.fixture(scope="session")
def small_fit(small_steps: "eaid.StepSet") -> "eaid.Fit":
    return eaid.fit(small_steps)


@pytest.fixture(scope="session")
def small_gains(small_fit: "eaid.Fit") -> "eaid.Gains":
    return eaid.tune_rc(small_fit)


@pytest.fixture(scope="session")
def small_files(
    small_fit: "eaid.Fit", small_gains: "eaid.Gains", tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, Path]:
    """fit.json and gains.json of the small set."""
    folder = tmp_path_factory.mktemp("small")
    small_fit.save(folder / "fit.json")
    small_gains.save(folder / "gains.json")
    return folder / "fit.json", folder / "gains.json"


def _clutch_set(
    plant: Plant = REFERENCE_PLANT,
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
        torque = from_rest(plant, time_s, float(u))
        runs = torque + noise_nm * rng.normal(size=(repeats, len(time_s)))
        made.append(Level(float(u), time_s, runs, tuple(f"{u}-{r}" for r in range(repeats))))
    return StepSet("clutch", "%", "N·m", Apparatus(), tuple(made))


def _friction_set(
    kind: str, unit: str, curves: dict[float, Step], duration_s: float = 30.0, rate_hz: float = 100.0
) -> StepSet:
    time_s = np.arange(round(duration_s * rate_hz)) / rate_hz
    levels = tuple(Level(u, time_s, step_response(curve, time_s)[None], (f"{u}",)) for u, curve in curves.items())
    return StepSet(kind, unit, "N·m", Apparatus(surfaces=1), levels)


@pytest.fixture(scope="session")
def clutch_set() -> Callable[..., StepSet]:
    """Steps of a plant from rest, white noise on every run; the reference plant, noise-free, unless told otherwise."""
    return _clutch_set


@pytest.fixture(scope="session")
def friction_set() -> Callable[..., StepSet]:
    """Noise-free friction steps, one curve a level."""
    return _friction_set
