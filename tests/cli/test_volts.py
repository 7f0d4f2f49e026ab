"""A rig whose input is no duty: 30 … 300 V, or a current of some milliamperes, from a fit to the next fit."""

import json
from pathlib import Path

import numpy as np
import pytest

import eaid
from eaid.cli import main
from eaid.models.nonlinear import steady_torque, time_constants
from eaid.models.parameters import REFERENCE_PLANT, Nonlinear
from eaid.results.codec import text_of
from eaid.results.fit import Fit

NOISE = {"sensor_nm2_s": 1e-8, "ripple_s": 1e-8, "scatter": {"Ts": 0.0, "tau1": 0.0, "tau2": 0.0}}


def per(factor: float, p: Nonlinear = REFERENCE_PLANT) -> dict[str, object]:
    """The plant with an input of `factor` units a percent."""
    scaled = {name: [c / factor**k for k, c in enumerate(getattr(p, name))] for name in ("tau1", "tau2", "Ts")}
    return {"C": p.C, "u_range": [factor * u for u in p.u_range], **scaled}


def written(folder: Path, factor: float, unit: str) -> Path:
    """A fit.json of the reference plant in another unit."""
    levels = [factor * u for u in range(10, 101, 10)]
    data = {"kind": "clutch", "input_unit": unit, "output_unit": "N·m", "levels": levels, "sample_rate_hz": 100.0}
    path = folder / "fit.json"
    content = {"schema": "eaid/fit/1", "data": data, "nonlinear": per(factor), "uncertainty": {"noise": NOISE}}
    path.write_text(text_of(content), encoding="utf-8")
    return path


def assert_truth(fit: Fit, factor: float, rel: float) -> None:
    """The curves of the fit are those of the reference plant."""
    inputs = np.linspace(10, 100, 10)
    for curve in (steady_torque, lambda p, u: time_constants(p, u)[0], lambda p, u: time_constants(p, u)[1]):
        np.testing.assert_allclose(curve(fit.plant, factor * inputs), curve(REFERENCE_PLANT, inputs), rtol=rel)


@pytest.mark.parametrize(("factor", "unit"), [(3.0, "V"), (2.55, "a.u."), (1.2e-4, "A")])
def test_a_sequence_in_another_unit_leads_back_to_the_plant(factor: float, unit: str, tmp_path: Path) -> None:
    path, table, logs, again = (tmp_path / name for name in ("fit.json", "next.csv", "logs", "again.json"))
    written(tmp_path, factor, unit)
    low, high = 10 * factor, 100 * factor
    words = ["--want", "Ts=3,tau1=10,tau2=30", "--limits", "engagements=2,rest=8", "--no-check", "-q"]
    assert main.run(["plan", str(path), "--excitation", *words, "-o", str(table)]) == 0
    assert table.read_text(encoding="utf-8").splitlines()[0] == f"time_s,input ({unit})"
    values = np.loadtxt(table, delimiter=",", skiprows=1)[:, 1]
    assert values.max() == pytest.approx(high) and values[values > 0].min() == pytest.approx(low)
    call = ["synth", "--plant", str(path), "--duty-file", str(table), "--clean", "--rate-hz", "1000"]
    assert main.run([*call, "--repeats", "1", "-o", str(logs), "-q"]) == 0
    (log,) = logs.iterdir()
    assert log.read_text(encoding="utf-8").splitlines()[1] == f"time_s,input ({unit}),torque_nm"
    assert np.loadtxt(log, delimiter=",", skiprows=2)[:, 1].max() == pytest.approx(high)
    assert main.run(["fit", str(logs), "-o", str(again), "-q"]) == 0
    fit = eaid.load(again)
    assert isinstance(fit, Fit) and fit.data.input_unit == unit
    assert fit.plant.u_range == pytest.approx((low, high))
    assert_truth(fit, factor, 1e-5)


@pytest.mark.parametrize("kind", ["random", "staircase", "multisine", "chirp", "prbs", "closed-loop"])
def test_every_excitation_is_that_of_the_same_rig_in_percent(kind: str, tmp_path: Path) -> None:
    """Three volts a percent: three times the input, the same output; nothing ends at 100."""
    tables = []
    for factor, unit in ((3.0, "V"), (1.0, "%")):
        folder = tmp_path / unit
        folder.mkdir()
        words = ["--excitation", kind, "--shape", "duration_s=60,hold_s=0.5:4", "--rate-hz", "100", "-q"]
        call = ["synth", "--plant", str(written(folder, factor, unit)), *words, "-o", str(folder / "logs")]
        assert main.run(call) == 0
        (log,) = (folder / "logs").iterdir()
        assert log.read_text(encoding="utf-8").splitlines()[1].split(",")[1] in ("input (V)", "duty_pct")
        tables.append(np.loadtxt(log, delimiter=",", skiprows=2))
    volts, percent = tables
    assert 200 < volts[:, 1].max() <= 300
    np.testing.assert_allclose(volts[:, 1], 3 * percent[:, 1], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(volts[:, 2:], percent[:, 2:], rtol=0, atol=1.1 / 1024)  # one digit of the sensor


def test_the_public_functions_plan_and_synthesise_in_volts(tmp_path: Path) -> None:
    fit = eaid.load(written(tmp_path, 3.0, "V"))
    assert isinstance(fit, Fit)
    plan = eaid.plan_excitation(fit, want={"Ts": 5.0, "tau1": 20.0}, check=False)
    assert plan.input_unit == "V" and max(value for _, value in plan.duty) == pytest.approx(300)
    shape = {"duration_s": 90.0, "hold_s": (0.5, 8.0), "duty": (60.0, 240.0)}
    logs = eaid.synth(fit, excitation="random", shape=shape, clean=True, rate_hz=100.0)
    (log,) = logs.recorded
    assert (log.input[log.input > 0].min(), log.input.max()) == (60.0, 240.0)
    assert eaid.fit(logs).data.input_unit == "V"
    steps = eaid.plan(fit, want={"Ts": 5.0}, check=False)
    assert steps.input_unit == "V" and max(steps.levels) == 300.0


def test_small_inputs_have_files_of_their_own(tmp_path: Path) -> None:
    """Levels of 10.1, 10.2, 10.25 mA are not all 000.0."""
    path, logs = written(tmp_path, 1.2e-4, "A"), tmp_path / "logs"
    call = ["synth", "--plant", str(path), "--levels", "0.00201,0.002011,0.012", "--repeats", "1", "--rate-hz", "20"]
    assert main.run([*call, "--clean", "-o", str(logs), "-q"]) == 0
    names = ["synthetic-clutch-0.00201-r1.csv", "synthetic-clutch-0.002011-r1.csv", "synthetic-clutch-0.012-r1.csv"]
    assert sorted(file.name for file in logs.iterdir()) == names


def test_a_rig_that_names_no_unit_is_recorded_in_arbitrary_ones(tmp_path: Path) -> None:
    """Levels from file names carry none; 30 … 300 of it are not called percent."""
    path, logs, again = written(tmp_path, 3.0, ""), tmp_path / "logs", tmp_path / "again.json"
    call = [
        "synth",
        "--plant",
        str(path),
        "--levels",
        "60,150,300",
        "--repeats",
        "1",
        "--hold",
        "30",
        "--rate-hz",
        "50",
    ]
    assert main.run([*call, "--clean", "-o", str(logs), "-q"]) == 0
    assert main.run(["fit", str(logs), "-o", str(again), "-q"]) in (0, 4)
    data = json.loads(again.read_text(encoding="utf-8"))["data"]
    assert data["levels"] == [60, 150, 300] and data["input_unit"] == "a.u."


def test_limits_of_another_rig_are_its_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, table = written(tmp_path, 3.0, "V"), tmp_path / "next.csv"
    words = ["plan", str(path), "--excitation", "--no-check", "--want", "Ts=5", "-q", "-o", str(table)]
    assert main.run([*words, "--limits", "duty=60:240"]) == 0
    assert np.loadtxt(table, delimiter=",", skiprows=1)[:, 1].max() == 240.0
    assert main.run([*words, "--force", "--limits", "duty=240:60"]) == 2
    assert "give two inputs that rise" in capsys.readouterr().err


def test_a_unit_that_no_file_can_hold_is_written_otherwise(tmp_path: Path) -> None:
    """A lone surrogate in an edited fit.json ended plan and synth with a bug's exit code."""
    path = written(tmp_path, 3.0, "V")
    text = path.read_text(encoding="utf-8").replace('"V"', '"\\ud800V"')
    path.write_text(f"{text}\n", encoding="utf-8")  # no longer as eaid wrote it
    table = tmp_path / "plan.csv"
    assert main.run(["plan", str(path), "--no-check", "-o", str(table), "-q"]) == 0
    assert (tmp_path / "plan.duty.csv").read_text(encoding="utf-8").startswith("time_s,input (?V)\n")
    call = ["synth", "--plant", str(path), "--plan", str(table), "--rate-hz", "5"]
    assert main.run([*call, "-o", str(tmp_path / "logs"), "-q"]) == 0


@pytest.mark.parametrize("given", ["input=\udcff", "output=N\udcffm", "time=\udcffs"])
def test_an_option_that_is_not_utf8_is_refused(given: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Bytes of another encoding come from the shell as lone surrogates, which no file can hold."""
    for command in ("fit", "ingest"):
        assert main.run([command, "logs", "--units", given, "-o", str(tmp_path / "x")]) == 2
        assert capsys.readouterr().err.startswith("error: --units ")
    assert list(tmp_path.iterdir()) == []
