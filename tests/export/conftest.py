"""The paper's gains and the reference plant as typed results; their exports; scenarios with the replay's answer."""

import math
import shutil
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eaid.control.gains import paper_gains
from eaid.export import reference as law
from eaid.export.constants import Timing, inverse_constants, pi_constants, plant_constants, rc_constants, rounded
from eaid.export.export import ExportFolder
from eaid.export.export import export as exported_to
from eaid.export.job import Origin
from eaid.models.parameters import PAPER_LINEAR, REFERENCE_PLANT, Nonlinear
from eaid.options import ExportOptions
from eaid.replay import references
from eaid.replay.controllers import CONTROLLERS, Knowledge
from eaid.replay.loop import reference_rate, replay
from eaid.replay.plant import PlantParameters, plant_parameters
from eaid.replay.rehab import rehabilitate
from eaid.replay.rig import Rig
from eaid.results.codec import from_plain
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.replay import Exercise

DT = 1e-3
LAWS = ("pi", "rc", "inverse")
COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)]
STRICT = ["-std=c99", "-ffp-contract=off", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-pedantic"]
PLANT = replace(REFERENCE_PLANT, release=(0.3, 5.0))
"""With release constants, so that every line of the plant is used."""
KNOWN = Knowledge(PLANT, PAPER_LINEAR, *paper_gains())


def wound_of(gains: Any) -> dict[str, Any]:
    """Anti-windup as gains.json holds it."""
    back = gains.back_calculation
    return {"method": "back-calculation" if back else "conditional", "gain": back}


def gains_of(rc: Any = KNOWN.rc, pi: Any = KNOWN.pi, **further: Any) -> Gains:
    """Plain gains as gains.json holds them."""
    plain = {
        "model": {"a0": rc.a0, "b0": rc.b0, "c0": rc.c0},
        "rc": {
            "K_P": rc.K_P, "K_D": rc.K_D, "B_hat": rc.B_hat, "epsilon": rc.epsilon, "gamma": rc.gamma,
            "rho": {"constant": rc.rho_constant, "slope": rc.rho_slope}, "Q": [[1.0, rc.Q12], [rc.Q12, rc.Q22]],
            "anti_windup": wound_of(rc), "guaranteed": True, "phi_holds": True,
        },
        "pi": {"K_P": pi.K_P, "K_I": pi.K_I, "anti_windup": wound_of(pi)},
        "duty_limits_pct": [rc.duty_min, rc.duty_max],
        **further,
    }  # fmt: skip
    return from_plain(plain, Gains, "test")


def fit_of(plant: Any = PLANT, data: dict[str, Any] | None = None, **further: Any) -> Fit:
    """A plant as fit.json holds it."""
    release = {"release": {"tau1": plant.release[0], "tau2": plant.release[1]}} if plant.release else {}
    nonlinear = {"tau1": plant.tau1, "tau2": plant.tau2, "Ts": plant.Ts, "u_range": plant.u_range, "C": plant.C}
    plain = {key: list(value) if isinstance(value, tuple) else value for key, value in nonlinear.items()}
    return from_plain({"nonlinear": {**plain, **further}, **release, **({"data": data} if data else {})}, Fit, "test")


STRANGE = Nonlinear(
    tau1=(-0.0395, 2e-3, 0.0),
    tau2=(0.1, 0.0, 0.0),
    Ts=(-0.5, 0.02, 0.0, 1e-6),
    u_range=(20.0, 90.0),
    C=0.6,
    release=None,
)
"""A plant at every floor: τ1 below 1 ms, τ2 below τ1, T_s below 0, no release."""
STRANGE_RC = KNOWN.rc._replace(gamma=2.0, epsilon=0.4, back_calculation=0.03, duty_min=5.0, duty_max=95.0)
"""A soft switch that is never 0 nor 1, back-calculation, narrower limits."""
STRANGE_PI = KNOWN.pi._replace(K_I=0.0, back_calculation=0.05, duty_min=5.0, duty_max=95.0)


Exporter = Callable[..., Path]


def export(gains: Gains | None, fit: Fit | None, given: dict[str, Any]) -> ExportFolder:
    """An export with fields of `ExportOptions`, its folder, `force`, and what made it."""
    options = dict(given)
    folder, force = options.pop("folder"), options.pop("force", False)
    origin = Origin(options.pop("command", ""), options.pop("inputs", ()))
    return exported_to(gains, fit, ExportOptions(**options), folder, force, origin)


@pytest.fixture(scope="session")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Exporter:
    """An export of the paper's gains and the reference plant; each one once."""
    made: dict[Any, Path] = {}

    def export_once(target: str = "c", precision: str = "double", laws: tuple[str, ...] | None = None) -> Path:
        key = (target, precision, laws)
        if key not in made:
            folder = tmp_path_factory.mktemp("export") / f"{target}_{precision}"
            export(gains_of(), fit_of(), {"target": target, "precision": precision, "law": laws, "folder": folder})
            made[key] = folder
        return made[key]

    return export_once


@dataclass(frozen=True)
class Scenario:
    """A reference and its rate, and what the replay's own law and plant make of it."""

    name: str
    law: str
    reference: list[float]
    rate: list[float]
    torque: np.ndarray
    duty: np.ndarray


def scenario(name: str, law_name: str, plant: PlantParameters | None = None) -> Scenario:
    """One of the replay's scenarios; of the rehabilitation its torque loop."""
    plant = plant_parameters(PLANT) if plant is None else plant
    chosen = CONTROLLERS[law_name](KNOWN)
    if name == "rehab":
        done = rehabilitate(plant, chosen, Exercise(mode_s=6.0, uncounted_s=2.0), Rig(), DT).replay
        values = done.reference_nm
        # as the rehabilitation gives it: the difference to the reference of before, which is 0 at first
        rate = ((values - np.concatenate([[0.0], values[:-1]])) / DT).tolist()
    else:
        made = {"steps": references.steps, "multisine": references.multisine, "sweep": references.sweep}[name](DT)
        values = made.torque_nm
        done = replay(plant, chosen, values, Rig(), DT)
        rate = reference_rate(values, DT, chosen.looks_ahead).tolist()
    return Scenario(name, law_name, values.tolist(), rate, done.torque_nm, done.duty_pct)


@pytest.fixture(scope="session")
def played() -> Callable[[str, str], Scenario]:
    """Each scenario under each law, once."""
    made: dict[tuple[str, str], Scenario] = {}

    def play(name: str, law_name: str) -> Scenario:
        if (name, law_name) not in made:
            made[name, law_name] = scenario(name, law_name)
        return made[name, law_name]

    return play


def constants(precision: str = "double", dt: float = DT, **timing: Any) -> dict[str, Any]:
    """Constants of every law in one precision."""
    t = Timing(dt, precision, **timing)
    made = {
        "pi": pi_constants(KNOWN.pi, t),
        "rc": rc_constants(KNOWN.rc, t),
        "inverse": inverse_constants(PLANT, (0.0, 100.0), t),
        "plant": plant_constants(PLANT, t),
    }
    return {name: rounded(value, precision) for name, value in made.items()}


def closed_loop(run: Scenario, precision: str = "double") -> Iterator[tuple[Any, Any]]:
    """Duty and torque of the plain Python reference, sample by sample, in one precision."""
    c = constants(precision)
    cast = np.float32 if precision == "single" else float
    step = {"pi": law.pi_step, "rc": law.rc_step, "inverse": law.inverse_step}[run.law]
    state = (law.inverse_init if run.law == "inverse" else law.integral_init)(c[run.law], c[run.law].dt)
    plant = law.plant_init(c["plant"], c["plant"].dt)
    torque = cast(0.0)
    for reference, rate in zip(run.reference, run.rate, strict=True):
        state, duty = step(c[run.law], state, cast(reference), cast(rate), torque)
        yield duty, torque
        plant, torque = law.plant_step(c["plant"], plant, duty)


def compiled(folder: Path, compiler: str, *flags: str, name: str = "check") -> Path:
    """The check program of an export, compiled strictly."""
    out = folder / f"check-{compiler}{''.join(flags)}-{name}"
    if not out.exists():
        command = [compiler, *STRICT, *(flags or ("-O2",)), "-o", str(out), "check.c", "eaid_control.c", "-lm"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0 and done.stderr == "", done.stderr
    return out


def logged(program: Path, run: Scenario) -> np.ndarray:
    """Columns time, duty, torque, reference of the exported C in closed loop on a scenario's reference."""
    lines = "\n".join(f"{reference!r} {rate!r}" for reference, rate in zip(run.reference, run.rate, strict=True))
    done = subprocess.run([program, "log", run.law, "-"], input=lines, capture_output=True, text=True, check=True)
    return np.array([[float(cell) for cell in line.split(",")] for line in done.stdout.splitlines()[1:]])


def rising(seconds: float, slope: float) -> list[float]:
    """A ramp at the control rate."""
    return [slope * k * DT for k in range(math.floor(seconds / DT))]
