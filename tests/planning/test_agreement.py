"""A session of steps and one sequence are planned on the same noise: that of the shipped clutch."""

import pytest

import eaid
from eaid.synth.datasets import shipped


@pytest.mark.slow
def test_what_steps_take_is_the_same_beside_a_sequence_as_by_itself() -> None:
    fit = eaid.fit(eaid.read(shipped()["clutch"]), model=("nonlinear", "friction"))
    want = {"Ts": 8.0, "tau1": 20.0}
    steps = eaid.plan(fit, want=want, check=False)
    sequence = eaid.plan(fit, want=want, check=False, excitation=True)
    assert steps.met and sequence.classic_time_on_rig_s == steps.time_on_rig_s
    assert sequence.met and sequence.time_on_rig_s < steps.time_on_rig_s
