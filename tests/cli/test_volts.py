"""A rig whose input is no duty: 30 … 300 V, or a current of some milliamperes, from a fit to the next fit."""

import json
from pathlib import Path

import numpy as np
import pytest

import eaid

NOISE = {"noise": {"sensor_nm2_s": 1e-8, "ripple_s": 1e-8, "scatter": {"Ts": 0.0, "tau1": 0.0, "tau2": 0.0}}}


@pytest.fixture
def rig_of(by_hand):
    """Writes fit.json of the reference plant with an input of `factor` units a percent."""

    def write(factor, unit, **parts):
        levels = [factor * u for u in range(10, 101, 10)]
        data = {"kind": "clutch", "input_unit": unit, "output_unit": "N·m", "levels": levels, "sample_rate_hz": 100.0}
        by_hand({"data": data, "uncertainty": NOISE, "linear": None, **parts}, k=factor)

    return write


def columns_of(folder):
    """The heading and the rows of the folder's only log."""
    (log,) = Path(folder).iterdir()
    return log.read_text(encoding="utf-8").splitlines()[1], np.loadtxt(log, delimiter=",", skiprows=2)


@pytest.mark.slow
@pytest.mark.parametrize(("factor", "unit"), [(3.0, "V"), (2.55, "a.u."), (1.2e-4, "A")])
def test_a_sequence_in_another_unit_leads_back_to_the_plant(factor, unit, rig_of, run_eaid):
    rig_of(factor, unit)
    words = "--excitation --want Ts=3,tau1=10,tau2=30 --limits engagements=2,rest_s=8 --no-check -q -o next.csv"
    assert run_eaid(f"plan fit.json {words}").code == 0
    assert Path("next.csv").read_text(encoding="utf-8").splitlines()[0] == f"time_s,input ({unit})"
    values = np.loadtxt("next.csv", delimiter=",", skiprows=1)[:, 1]
    assert values.max() == pytest.approx(100 * factor) and values[values > 0].min() == pytest.approx(10 * factor)
    words = "--duty-file next.csv --clean --rate-hz 1000 --repeats 1 -o logs -q"
    assert run_eaid(f"synth --plant fit.json {words}").code == 0
    head, rows = columns_of("logs")
    assert head == f"time_s,input ({unit}),torque_nm" and rows[:, 1].max() == pytest.approx(100 * factor)
    assert run_eaid("fit logs -o again.json -q").code == 0
    fit, truth = eaid.load("again.json"), eaid.load("fit.json")
    assert fit.data.input_unit == unit and fit.plant.u_range == pytest.approx((10 * factor, 100 * factor))
    for name, high in (("Ts", 4), ("tau1", 3), ("tau2", 3)):
        scaled = (10.0 ** np.arange(high)) * np.array(getattr(truth.plant, name)) * factor ** np.arange(high)
        ours = (10.0 ** np.arange(high)) * np.array(getattr(fit.plant, name)) * factor ** np.arange(high)
        assert ours.sum() == pytest.approx(scaled.sum(), rel=1e-4)


@pytest.mark.parametrize("kind", ["random", "staircase", "chirp", "closed-loop"])
def test_every_excitation_is_that_of_the_same_rig_in_percent(kind, rig_of, run_eaid):
    """Three hundredths of a volt a percent: so much of the input, the same output, also while it is let go."""
    tables = []
    for factor, unit in ((0.03, "V"), (1.0, "%")):
        rig_of(factor, unit, release={"tau1": 0.2, "tau2": 1.0})
        shape = {"chirp": "", "random": ",hold_s=0.5:4,rest_s=3"}.get(kind, ",hold_s=0.5:4")
        words = f"--plant fit.json --excitation {kind} --shape duration_s=60{shape} --rate-hz 100 -q -o {unit}"
        assert run_eaid(f"synth {words}").code == 0
        head, rows = columns_of(unit)
        assert head.split(",")[1] == ("input (V)" if unit == "V" else "duty_pct")
        tables.append(rows)
    in_volts, percent = tables
    assert 2 < in_volts[:, 1].max() <= 3
    np.testing.assert_allclose(in_volts[:, 1], 0.03 * percent[:, 1], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(in_volts[:, 2:], percent[:, 2:], rtol=0, atol=1.1 / 1024)  # one digit of the sensor


def test_small_inputs_have_files_of_their_own_and_no_unit_is_an_arbitrary_one(rig_of, run_eaid):
    rig_of(1.2e-4, "A")
    words = "synth --plant fit.json --levels 0.00201,0.002011,0.012 --repeats 1 --rate-hz 20 --clean -o small -q"
    assert run_eaid(words).code == 0
    names = [f"synthetic-clutch-{level}-r1.csv" for level in ("0.00201", "0.002011", "0.012")]
    assert sorted(file.name for file in Path("small").iterdir()) == names
    rig_of(3.0, "")
    assert eaid.load("fit.json").data.input_unit == "a.u." and "300 a.u.;" in eaid.load("fit.json").summary()
    words = "synth --plant fit.json --levels 60,150,300 --repeats 1 --hold 30 --rate-hz 50 --clean -o logs -q"
    assert run_eaid(words).code == 0
    assert run_eaid("fit logs -o again.json -q --ci none").code in (0, 4)
    data = json.loads(Path("again.json").read_text(encoding="utf-8"))["data"]
    assert data["levels"] == [60, 150, 300] and data["input_unit"] == "a.u."
