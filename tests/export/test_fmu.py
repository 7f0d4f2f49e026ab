"""The FMUs: valid, alike from run to run, and in FMPy's hands the replay's own loop."""

import zipfile

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu

import eaid

from .conftest import COMPILERS, DT, LAWS, STRICT, fit_of, gains_of, in_code, ran


class Unit:
    """One FMU, instantiated by FMPy."""

    def __init__(self, folder, law, work):
        path = folder / f"eaid_{in_code(law)}.fmu"
        described = fmpy.read_model_description(str(path))
        self.at = {v.name: v.valueReference for v in described.modelVariables}
        self.unit = FMU2Slave(
            guid=described.guid, unzipDirectory=fmpy.extract(str(path), str(work / law)),
            modelIdentifier=described.coSimulation.modelIdentifier, instanceName=law,
        )  # fmt: skip
        self.unit.instantiate()
        self.unit.setupExperiment(startTime=0.0)
        self.unit.enterInitializationMode()
        self.unit.exitInitializationMode()

    def step(self, k, wanted, dt=DT, **inputs):
        self.unit.setReal([self.at[name] for name in inputs], list(inputs.values()))
        self.unit.doStep(k * dt, dt)
        return self.unit.getReal([self.at[wanted]])[0]

    def status(self):
        return self.unit.getInteger([self.at["status"]])[0]


@pytest.fixture
def unit(exported, tmp_path):
    made = []

    def make(law, precision="double"):
        made.append(Unit(exported("fmu", precision), law, tmp_path))
        return made[-1]

    yield make
    for one in made:
        one.unit.terminate()
        one.unit.freeInstance()


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("law", [*LAWS, "plant"])
def test_fmpy_finds_nothing_wrong(exported, law, precision):
    path = exported("fmu", precision) / f"eaid_{in_code(law)}.fmu"
    assert validate_fmu(str(path)) == []
    described = fmpy.read_model_description(str(path))
    assert float(described.defaultExperiment.stepSize) == DT
    assert not described.coSimulation.canHandleVariableCommunicationStepSize
    units = {v.name: v.unit for v in described.modelVariables if v.unit}
    assert units["duty"] == "%" and units["torque"] == "N·m"


@pytest.mark.parametrize(
    ("law", "precision", "most"),
    [*(pytest.param(law, "double", 1e-12, marks=pytest.mark.slow) for law in LAWS), ("rc", "single", 1e-5)],
)
def test_controller_and_plant_in_fmpy_are_the_replay(unit, played, law, precision, most):
    run = played("multisine", law)
    control, plant, torque = unit(law, precision), unit("plant", precision), 0.0
    for k in range(4000):
        assert abs(torque - run.torque[k]) <= most
        duty = control.step(k, "duty", reference=run.reference[k], reference_rate=run.rate[k], torque=torque)
        torque = plant.step(k, "torque", duty=duty)


def test_the_plant_as_a_user_simulates_it_is_the_models_step_response(exported):
    sent = np.zeros(1001, dtype=[("time", float), ("duty", float)])
    sent["time"], sent["duty"] = np.arange(1001) * DT, 60.0
    path = str(exported("fmu") / "eaid_plant.fmu")
    got = fmpy.simulate_fmu(path, stop_time=1.0, step_size=DT, output_interval=DT, input=sent, output=["torque"])
    assert got["torque"] == pytest.approx(fit_of().predict(duty=60.0, t=got["time"])[60.0].to_numpy(), abs=1e-12)


def test_faults_are_told(unit):
    control = unit("pi")
    assert control.step(0, "duty", reference=1.0, torque=0.0) == 21.0 and control.status() == 0
    control.unit.setReal([control.at["duty_on_fault"]], [5.0])
    assert control.step(1, "duty", reference=float("nan")) == 5.0 and control.status() == 2
    assert control.step(2, "duty", reference=9.0) == 100.0 and control.status() == 8
    with pytest.raises(FMICallException):
        control.step(3, "duty", dt=2 * DT, reference=1.0)
    with pytest.raises(FMICallException):
        control.unit.setReal([control.at["duty"]], [1.0])


def test_reset_begins_anew_and_the_slope_can_be_made_inside(unit):
    control = unit("rc")

    def anew(filtered):
        control.unit.reset()
        control.unit.setBoolean([control.at["use_rate_filter"]], [filtered])
        return [control.step(k, "duty", reference=0.01 * k, torque=0.0) for k in range(20)]

    first, with_slope = anew(False), anew(True)
    assert anew(False) == first
    assert with_slope[0] == first[0] and with_slope[-1] > first[-1]


@pytest.mark.slow
@pytest.mark.parametrize("law", [*map(in_code, LAWS), "plant"])
def test_the_wrapper_is_clean_and_its_sources_make_an_fmu_of_their_own(exported, tmp_path, law):
    with zipfile.ZipFile(exported("fmu") / f"eaid_{law}.fmu") as file:
        file.extractall(tmp_path)
    folder = tmp_path / "sources"
    sources = sorted(path.name for path in folder.glob("*.c"))
    for compiler in COMPILERS:
        done = ran(compiler, *STRICT, "-O2", "-fPIC", "-shared", "-o", "x.so", *sources, cwd=folder)
        assert done.returncode == 0 and done.stderr == "", done.stderr
    ran(COMPILERS[0], f"-DFMI2_FUNCTION_PREFIX=eaid_{law}_", "-c", "fmi2_wrapper.c", "-o", "w.o", cwd=folder)
    named = ran("nm", "w.o", cwd=folder).stdout
    assert f"T eaid_{law}_fmi2DoStep" in named and " T fmi2" not in named


def test_an_fmu_of_sources_alone_where_no_compiler_is(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", "")
    eaid.export(gains_of(), tmp_path / "x", target="fmu", law=("pi",))
    with zipfile.ZipFile(tmp_path / "x" / "eaid_pi.fmu") as file:
        assert not [name for name in file.namelist() if name.startswith("binaries")]
    assert validate_fmu(str(tmp_path / "x" / "eaid_pi.fmu")) == []


@pytest.mark.slow
def test_the_same_export_gives_the_same_bytes(exported, tmp_path):
    eaid.export(gains_of(), tmp_path / "fmu_double", fit_of(), target="fmu")
    for path in sorted((tmp_path / "fmu_double").iterdir()):
        assert path.read_bytes() == (exported("fmu") / path.name).read_bytes(), path.name
