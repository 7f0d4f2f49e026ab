"""The paper's gains and the reference plant as a script writes them, their exports, and the replays of both."""

import copy
import shutil
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eaid
from eaid.export import constants, job
from eaid.export import reference as plain_python

from .. import conftest as shared

DT = 1e-3
LAWS = ("pi", "rc", "pi-feedforward", "inverse")
FED = {"K_P": 30.0, "K_I": 60.0, "B_hat": 7.0}
COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)]
STRICT = ["-std=c99", "-ffp-contract=off", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-pedantic"]
PAPER = {**shared.GAINS, "rc": {**shared.GAINS["rc"], "guaranteed": True, "phi_holds": True},
         "controllers": {"pi-feedforward": FED}}  # fmt: skip
PLANT = {"schema": "eaid/fit/2", "nonlinear": shared.PLANT, "release": {"tau1": 0.3, "tau2": 5.0}}
"""With release constants, so that every line of the plant is used."""


def in_code(law: str) -> str:
    """A law as the exported code calls it."""
    return law.replace("-", "_")


def merged(plain: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """A copy with parts changed, at any depth; None takes a part out."""
    made = copy.deepcopy(plain)
    for key, value in changes.items():
        deeper = isinstance(value, dict) and isinstance(made.get(key), dict)
        made[key] = merged(made[key], value) if deeper else value
    return {key: value for key, value in made.items() if value is not None}


def gains_of(**changes: Any) -> "eaid.Gains":
    return shared.loaded(merged(PAPER, changes))


def fit_of(**changes: Any) -> "eaid.Fit":
    return shared.loaded(merged(PLANT, changes))


Exporter = Callable[..., Path]


@pytest.fixture(scope="session")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Exporter:
    """An export of the paper's gains and the reference plant; each one once."""
    made: dict[Any, Path] = {}

    def export_once(target: str = "c", precision: str = "double", laws: tuple[str, ...] | None = None) -> Path:
        key = (target, precision, laws)
        if key not in made:
            made[key] = tmp_path_factory.mktemp("export") / f"{target}_{precision}"
            eaid.export(gains_of(), made[key], fit_of(), target=target, precision=precision, law=laws)
        return made[key]

    return export_once


@dataclass(frozen=True)
class Replayed:
    """A reference and its rate, and what `eaid.simulate` makes of it."""

    law: str
    reference: list[float]
    rate: list[float]
    torque: np.ndarray
    duty: np.ndarray


def replayed(law: str, scenario: str | None, fit: Any, gains: Any, **options: Any) -> Replayed:
    """One scenario under one law; of the rehabilitation its torque loop."""
    run = eaid.simulate(fit, gains, scenario, controller=(law,), **options)
    columns = run.records[law].columns
    reference = columns["reference_nm"]
    if scenario == "rehab":  # it knows no sample ahead: the difference to the reference of before, which is 0 at first
        rate = np.diff(reference, prepend=0.0) / DT
    else:
        rate = np.append(np.diff(reference) / DT, 0.0) if law == "inverse" else np.gradient(reference, DT)
    return Replayed(law, reference.tolist(), rate.tolist(), columns["torque_nm"], columns["duty_pct"])


@pytest.fixture(scope="session")
def played() -> Callable[[str, str], Replayed]:
    """Each scenario under each law, once."""
    made: dict[tuple[str, str], Replayed] = {}

    def play(name: str, law: str) -> Replayed:
        if (name, law) not in made:
            made[name, law] = replayed(law, name, fit_of(), gains_of())
        return made[name, law]

    return play


@dataclass(frozen=True)
class Laws:
    """The exported plain Python: its classes, and its constants in the type of its precision."""

    law: Any
    constants: dict[str, Any]
    number: type

    def init(self, name: str) -> Any:
        return job.REFERENCES[in_code(name)](self.constants[in_code(name)])

    def closed_loop(self, run: Replayed, plant: Any = None) -> Iterator[tuple[Any, Any]]:
        """Duty and torque, sample by sample, on a replay's reference."""
        c = plant or self.constants["plant"]
        control, clutch, torque = self.init(run.law), self.law.Plant(c), self.number(0.0)
        for reference, rate in zip(run.reference, run.rate, strict=True):
            duty = control.step(*map(self.number, (reference, rate, torque)))
            yield duty, torque
            torque = clutch.step(duty)


def laws_of(gains: Any, fit: Any, precision: str = "double", **options: Any) -> Laws:
    """What an export holds, in the plain Python that its other languages repeat."""
    source, how = job.source_of(gains, fit), eaid.ExportOptions(precision=precision, **options)
    laws, rig = job.laws_of(source, how), job.rig_for(source, how)
    held = constants.constants_of(source.loops, source.plant, source.limits, laws, rig)
    series = constants.rounded(constants.SERIES[precision], precision)
    number = np.float32 if precision == "single" else float
    return Laws(plain_python, {name: constants.namespace(each, series) for name, each in held.items()}, number)


@pytest.fixture(scope="session")
def laws() -> Callable[[str], Laws]:
    """The plain Python in a precision."""
    return lambda precision="double": laws_of(gains_of(), fit_of(), precision)


def ran(*command: Any, cwd: Path, **further: Any) -> subprocess.CompletedProcess[str]:
    """A program's end: returncode, stdout, stderr."""
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False, **further)


def compiled(folder: Path, compiler: str = "", *flags: str) -> Path:
    """The check program of an export, compiled strictly."""
    compiler = compiler or COMPILERS[0]
    out = folder / f"check-{compiler}{''.join(flags)}"
    if not out.exists():
        done = ran(compiler, *STRICT, *(flags or ("-O2",)), "-o", out, "check.c", "eaid_control.c", "-lm", cwd=folder)
        assert done.returncode == 0 and done.stderr == "", done.stderr
    return out


def logged(command: list[Any], run: Replayed) -> np.ndarray:
    """Columns time, duty, torque, reference of an exported program in closed loop on a replay's reference."""
    lines = "\n".join(f"{reference!r} {rate!r}" for reference, rate in zip(run.reference, run.rate, strict=True))
    done = ran(*command, "log", in_code(run.law), "-", cwd=Path.cwd(), input=lines)
    return np.array([[float(cell) for cell in line.split(",")] for line in done.stdout.splitlines()[1:]])
