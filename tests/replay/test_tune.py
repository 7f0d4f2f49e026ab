"""Gains for a fit beside what they do on its plant: findings by code, the noise of a search, one verdict."""

import msgspec
import numpy as np
import pytest

from eaid.control.gains import pi_gains, rc_gains
from eaid.errors import DataError, UsageError
from eaid.models.parameters import REFERENCE_PLANT
from eaid.options import TuneOptions
from eaid.replay.controllers import pi_controller, rc_controller
from eaid.replay.references import multisine, replayed
from eaid.replay.tune import tune
from eaid.results.codec import from_plain
from eaid.results.fit import Fit

PLAIN = {
    "linear": {"a0": 1.36, "b0": 0.08, "c0": -2.42, "bounds": {"convention": "zero-offset", "B_m": 12.4, "B_M": 42.6}},
    "nonlinear": {
        "C": 0.85, "tau1": list(REFERENCE_PLANT.tau1), "tau2": list(REFERENCE_PLANT.tau2),
        "Ts": list(REFERENCE_PLANT.Ts), "u_range": [10.0, 100.0],
    },
}  # fmt: skip
FIT = from_plain(PLAIN, Fit, "f")
T = np.linspace(0.0, 3.0, 301)
SLOW = 2.0 + 0.5 * np.sin(T)


def with_covariance() -> Fit:
    sd = np.array([0.005, 0.01, 0.01, 0.01, 0.1, 0.1, 0.001, 0.02, 0.05, 0.02])
    model = {**PLAIN["nonlinear"], "covariance": {"matrix": np.diag(sd**2).tolist()}}
    return from_plain({**PLAIN, "nonlinear": model}, Fit, "f")


def codes(found) -> set[str]:
    return {one.code for one in found.findings}


def value(found, code: str, name: str):
    return next(one.values[name] for one in found.findings if one.code == code)


@pytest.mark.slow
def test_the_papers_gains_are_replayed_on_the_multisine_which_they_need_not_cover():
    found = tune(FIT)
    told, reference = found.replayed, multisine(1e-3, 12.0)
    assert told.reference == "multisine" and told.counted_from_s == 5.0
    assert told.slope_nm_s == pytest.approx(reference.steepest_nm_s) and found.rc.Q_M == 5.0
    assert told.rc == replayed(REFERENCE_PLANT, rc_controller(rc_gains(found)), reference)
    assert told.pi == replayed(REFERENCE_PLANT, pi_controller(pi_gains(found)), reference)
    assert found.rc.ultimate_bound.replayed_nm == told.rc.max_abs_error_nm
    assert value(found, "slope-above-q-max", "slope") == told.slope_nm_s
    needs = {one.name: one for one in found.guarantee.conditions}
    assert needs["Q_M"].needed == told.slope_nm_s and needs["Q_M"].holds is False and found.guarantee.holds is False
    assert found.rc.Q_M_holds is None and found.optimized is None and found.unidentified is None


@pytest.mark.slow
def test_a_reference_of_the_users_own_is_covered():
    found = tune(FIT, reference=(T, SLOW), reference_name="mine.csv")
    assert found.replayed.reference == "mine.csv" and found.replayed.slope_nm_s == pytest.approx(0.5, rel=1e-3)
    assert found.replayed.slope_nm_s == found.rc.Q_M and found.rc.Q_M_holds is True
    assert not codes(found) & {"slope-above-q-max", "reference-beyond-plant", "designed-for-rig"}
    judged = tune(FIT, TuneOptions(q_max=0.4), reference=(T, SLOW))
    assert judged.rc.Q_M == 0.4 and judged.rc.Q_M_holds is False and "slope-above-q-max" in codes(judged)


@pytest.mark.slow
def test_a_reference_beyond_the_plant_is_told_with_both_torques():
    found = tune(FIT, reference=(T, 2.5 * SLOW))
    assert value(found, "reference-beyond-plant", "asked") == pytest.approx(6.25, abs=1e-3)
    assert value(found, "reference-beyond-plant", "highest") == pytest.approx(4.372, abs=1e-3)


@pytest.mark.slow
def test_a_scenario_stands_for_its_reference():
    assert pytest.approx(0.8, rel=1e-3) == tune(FIT, reference="ramp").rc.Q_M
    with pytest.raises(UsageError, match="no scenario 'loops'; there are steps, multisine, sweep, ramp"):
        tune(FIT, reference="loops")


def test_without_a_plant_nothing_is_replayed_():
    bare = msgspec.structs.replace(FIT, nonlinear=None)
    found = tune(bare)
    assert found.replayed is None and "nothing-to-replay-on" in codes(found)


@pytest.mark.slow
def test_an_unidentified_fit_is_refused_unless_it_is_asked_for_and_then_marked():
    shaky = from_plain({**PLAIN, "linear": {**PLAIN["linear"], "identifiable": False}}, Fit, "f")
    with pytest.raises(DataError, match="the linear model is not identifiable"):
        tune(shaky)
    found = tune(shaky, TuneOptions(allow_unidentified=True))
    assert "fit-not-identifiable" in codes(found) and found.unidentified
    assert "fit-not-identifiable" not in codes(tune(FIT))


@pytest.mark.slow
def test_a_rig_in_volts_is_told_what_its_gains_were_designed_for():
    data = {"input_unit": "V", "output_unit": "N", "levels": [100.0, 300.0], "sample_rate_hz": 1000.0}
    stretched = {
        **PLAIN["nonlinear"], "u_range": [30.0, 300.0],
        **{name: [c / 3.0**k for k, c in enumerate(PLAIN["nonlinear"][name])] for name in ("tau1", "tau2", "Ts")},
    }  # fmt: skip
    linear = {**PLAIN["linear"], "a0": 2.72, "b0": 0.16 / 3, "bounds": {"B_m": 18.6, "B_M": 63.9}}
    volts = from_plain({"data": data, "nonlinear": stretched, "linear": linear}, Fit, "v")
    found = tune(volts)
    assert value(found, "designed-for-rig", "pace") == pytest.approx(2.0)
    assert value(found, "designed-for-rig", "highest") == 300.0
    assert value(found, "designed-for-rig", "overshoot_pct") == 1.0
    assert value(found, "designed-for-rig", "settling_s") == pytest.approx(0.27 / 2)
