"""What a replay says of itself: doubts on the reference, units of gains, what is seen by nobody."""

import numpy as np
import pytest

from eaid.control.design import design
from eaid.control.options import DesignOptions
from eaid.errors import DataError, UsageError
from eaid.replay.options import SimulateOptions
from eaid.replay.references import multisine
from eaid.replay.simulate import simulate
from eaid.results.codec import from_plain
from eaid.results.fit import Fit
from eaid.results.gains import Gains

FIT = from_plain(
    {
        "nonlinear": {
            "C": 0.85, "tau1": [6.74e-3, 2.39e-2, -2.13e-4], "tau2": [0.93, 0.41, -2.64e-3],
            "Ts": [0.032, 9.2e-3, 2.1e-4, 1.32e-6], "u_range": [10, 100],
        },
        "linear": {"a0": 1.36, "b0": 0.08, "c0": -2.42, "bounds": {"B_m": 12.4, "B_M": 42.6}},
    },
    Fit, "f",
)  # fmt: skip
T = np.linspace(0, 2, 201)


def gains(Q_M: float) -> Gains:
    return design(FIT, DesignOptions(Q_M=Q_M))


def codes(*arguments: object, signal: np.ndarray = 1.0 + 0.0 * T, **options: object) -> dict[str, dict[str, object]]:
    found = simulate(FIT, *arguments, SimulateOptions(**options), (T, signal))  # type: ignore[arg-type]
    return {one.code: dict(one.values) for one in found.findings}


def test_a_reference_steeper_than_the_gains_were_made_for_is_told() -> None:
    slope = np.abs(np.sin(2 * T))
    steepest = float(np.abs(np.gradient(np.interp(np.arange(0, 2, 1e-3), T, slope), 1e-3)).max())
    told = codes(gains(1.0), signal=slope)["reference-above-q-max"]
    assert told["slope"] == pytest.approx(steepest, rel=1e-3) and told["Q_M"] == 1.0
    assert "reference-above-q-max" not in codes(gains(2.5), signal=slope)
    assert "reference-above-q-max" not in codes(None, signal=slope)
    steps = simulate(FIT, gains(1.0), SimulateOptions(scenario="steps", duration=9.0))  # steps have no slope
    assert "reference-above-q-max" not in {one.code for one in steps.findings}


def test_a_reference_above_the_plant_is_told() -> None:
    assert codes(None, signal=5.0 + 0.0 * T)["reference-above-plant"]["highest"] == pytest.approx(4.372, abs=1e-3)
    assert "reference-above-plant" not in codes(None, signal=4.3 + 0.0 * T)


def test_without_gains_it_is_said_and_the_others_are_replayed() -> None:
    found = simulate(FIT, None, SimulateOptions(), (T, 1.0 + 0.0 * T))
    assert set(found.records) == {"open-loop", "inverse"} and "no-gains" in {one.code for one in found.findings}
    assert set(simulate(FIT, gains(5.0), SimulateOptions(), (T, 1.0 + 0.0 * T)).records) == {"rc", "pi"}
    swept = simulate(FIT, gains(5.0), SimulateOptions(scenario="sweep", rate_hz=200.0))
    assert set(swept.records) == {"rc", "pi", "open-loop"}


def test_the_rate_is_the_rigs() -> None:
    assert simulate(FIT, None, SimulateOptions(), (T, T)).head.dt_s == 1e-3
    assert simulate(FIT, None, SimulateOptions(rate_hz=250.0), (T, T)).head.dt_s == 4e-3


def test_what_contradicts_itself_is_refused() -> None:
    with pytest.raises(UsageError, match="exclude each other"):
        simulate(FIT, None, SimulateOptions(scenario="steps"), (T, T))
    with pytest.raises(UsageError, match="no scenario 'loops'"):
        simulate(FIT, None, SimulateOptions(scenario="loops"))
    with pytest.raises(UsageError, match="name each controller once"):
        simulate(FIT, None, SimulateOptions(controllers=("inverse", "inverse")), (T, T))
    with pytest.raises(DataError, match="the gains are for an input in % and an output in N·m"):
        volts = from_plain({"data": {"input_unit": "V"}, "nonlinear": {**plain()}}, Fit, "v")
        simulate(volts, gains(5.0), SimulateOptions(), (T, T))


def plain() -> dict[str, object]:
    return {"tau1": [0.3, 0, 0], "tau2": [3, 0, 0], "Ts": [0, 0.01, 0, 0], "u_range": [30, 300], "C": 0.85}


def test_scenarios_count_from_where_they_have_settled() -> None:
    found = simulate(FIT, None, SimulateOptions(duration=7.0))
    reference = multisine(1e-3, 7.0)
    one = found.records["inverse"]
    error = (one.columns["torque_nm"] - reference.torque_nm)[5000:]
    assert one.metrics.rms_error_nm == pytest.approx(float(np.sqrt(np.mean(error**2))), rel=1e-12)
    assert found.head.counted_from_s == 5.0
