"""Planned sequences: limits kept, widths as predicted, shorter than random."""

from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest

import eaid
from eaid.options import Limits
from eaid.planning.sequences import plan_excitation, recording_widths, refuse_scattered
from eaid.plant.dynamics import REFERENCE_PLANT
from eaid.results.models import Noise
from eaid.synth.files import shipped

NOISE = Noise(1.8e-7, 6e-5, {"Ts": 0.0, "tau1": 0.0, "tau2": 0.0})
WANT = {"tau1": 8.0, "tau2": 25.0, "Ts": 3.0}


@pytest.mark.slow
def test_a_plan_keeps_its_limits_and_its_widths() -> None:
    limits = Limits(duty=(20.0, 90.0), hold_s=(0.5, 12.0), rest_s=3.0, engagements=3)
    p = REFERENCE_PLANT
    found = plan_excitation(p, NOISE, WANT, limits)
    assert found.met and found.engagements >= 3
    at, duty = np.array(found.duty).T
    assert at[0] == 0.0 and duty[0] == 0.0 and duty.max() <= 90.0
    assert set(duty[duty > 0]) and duty[duty > 0].min() > 0
    rests = np.flatnonzero(duty[:-1] == 0)
    assert np.diff(at)[rests].min() >= 3.0 - 1e-9
    assert found.time_on_rig_s == at[-1]


@pytest.mark.slow
def test_a_sequence_is_shorter_than_steps_and_what_those_take_is_the_same_beside_it() -> None:
    fit = eaid.fit(eaid.read(shipped()["clutch"]), model=("nonlinear", "friction"))
    want = {"Ts": 8.0, "tau1": 20.0}
    steps = eaid.plan(fit, want=want, check=False)
    sequence = eaid.plan(fit, want=want, check=False, excitation=True)
    assert steps.met and sequence.classic_time_on_rig_s == steps.time_on_rig_s
    assert sequence.met and sequence.time_on_rig_s < steps.time_on_rig_s


@pytest.mark.parametrize(
    "wrong", [{"limits": "duty=50:20"}, {"limits": "hold_s=3:1"}, {"want": {"x": 1.0}}, {"want": {"Ts": -1.0}}]
)
def test_limits_that_mean_nothing_are_refused(wrong: dict[str, Any], small_fit: eaid.Fit) -> None:
    with pytest.raises(eaid.UsageError):
        eaid.plan(small_fit, excitation=True, **wrong)


def test_widths_that_scatter_keeps_out_of_reach_are_refused_at_once() -> None:
    """Sixty engagements leave t(59)/√60 = 0.258 of a scatter of 13 %, which is 3.4 %."""
    wild = Noise(1.8e-7, 6e-5, {"Ts": 0.13, "tau1": 0.0, "tau2": 0.0})
    refuse_scattered(wild, {"Ts": 3.5, "tau2": 1.0})
    with pytest.raises(eaid.UsageError, match=r"3\.42 %"):
        refuse_scattered(wild, {"Ts": 3.4})


@pytest.mark.slow
def test_a_plant_of_another_pace_is_planned_in_its_own_time(small_fit: eaid.Fit) -> None:
    """Two hundred times as fast: holds of 0.3 s and more and 100 rows a second told its lags to half of themselves, and
    no hour was long enough."""

    def quicker(one: Any, *names: str) -> Any:
        faster = {name: tuple(c / 200 for c in getattr(one, name)) for name in names}
        return msgspec.structs.replace(one, **faster)

    old, nonlinear = small_fit.uncertainty, quicker(small_fit.nonlinear, "tau1", "tau2")
    noise = msgspec.structs.replace(
        old.noise, sensor_nm2_s=old.noise.sensor_nm2_s / 200, ripple_s=old.noise.ripple_s / 200
    )
    fast = msgspec.structs.replace(
        small_fit, nonlinear=nonlinear, plant_=quicker(small_fit.plant_, "tau1", "tau2"),
        uncertainty=msgspec.structs.replace(old, noise=noise),
    )  # fmt: skip
    want = {"Ts": 40.0, "tau1": 20.0, "tau2": 60.0}
    slow, quick = (eaid.plan(one, excitation=True, want=want, check=False) for one in (small_fit, fast))
    assert slow.met and quick.met and quick.time_on_rig_s < slow.time_on_rig_s / 50


NIGHTLY = [pytest.param(one, marks=pytest.mark.slow) for one in ({"falls": (0.6, 0.8)}, {"excess": 0.1}, {})]


@pytest.mark.slow
@pytest.mark.parametrize("own", [{"release_as_left": True, "release": (0.5, 5.0)}, *NIGHTLY], ids=str)
def test_a_sequence_is_planned_and_checked_with_what_falls_have_of_their_own(own: dict[str, Any]) -> None:
    """Planned as if they went as rises, ten times the time on the rig did not reach what was wanted."""
    p = replace(REFERENCE_PLANT, **own)
    found = plan_excitation(p, NOISE, WANT, Limits())
    rows = [recording_widths(found, p, NOISE, k) for k in range(5)]
    assert found.met and found.time_on_rig_s < 200
    for name, predicted in found.half_width_pct.items():
        assert np.median([row[name] for row in rows]) == pytest.approx(predicted, rel=0.2), name
