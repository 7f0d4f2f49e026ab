"""Planned sequences: limits kept, widths as predicted, shorter than random."""

from dataclasses import replace

import numpy as np
import pytest

from eaid.errors import UsageError
from eaid.models.parameters import REFERENCE_PLANT
from eaid.planning.excitation import measure, recording
from eaid.planning.recordings import disturbance_of
from eaid.recorded.design import EFFORT, Judge, Limits, plan_excitation, refuse_scattered
from eaid.uncertainty.rig_noise import Noise

NOISE = Noise(1.8e-7, 6e-5, (0.0, 0.0, 0.0))
WANT = {"tau1": 8.0, "tau2": 25.0, "Ts": 3.0}


@pytest.mark.slow
def test_a_plan_keeps_its_limits_and_its_widths() -> None:
    limits = Limits(input=(20.0, 90.0), rate_per_s=200.0, hold_s=(0.5, 12.0), rest_s=3.0, engagements=3)
    p = REFERENCE_PLANT
    found = plan_excitation(p, NOISE, WANT, limits)
    assert found.met and found.engagements >= 3
    at, duty = np.array(found.breaks).T
    assert at[0] == 0.0 and duty[0] == 0.0 and duty.max() <= 90.0
    assert set(duty[duty > 0]) and duty[duty > 0].min() > 0
    rests = np.flatnonzero(duty[:-1] == 0)
    assert np.diff(at)[rests].min() >= 3.0 - 0.06  # a rest begins where its ramp ends
    jumps = np.abs(np.diff(duty[:-1]))
    assert jumps.max() <= 200.0 * 0.05 + 1e-9  # in steps of 50 ms
    assert found.time_s == at[-1]


@pytest.mark.slow
def test_a_rig_in_volts_is_planned_as_the_same_rig_in_percent() -> None:
    p, few = REFERENCE_PLANT, {"tau1": 8.0, "Ts": 3.0}
    tau1, tau2, Ts = ([c / 3.0**k for k, c in enumerate(row)] for row in (p.tau1, p.tau2, p.Ts))
    volts = replace(p, tau1=tuple(tau1), tau2=tuple(tau2), Ts=tuple(Ts), u_range=(30.0, 300.0))
    in_percent = plan_excitation(p, NOISE, few, Limits(input=(10.0, 100.0)), seed=2)
    in_volts = plan_excitation(volts, NOISE, few, Limits(input=(30.0, 300.0), unit="V"), seed=2)
    np.testing.assert_allclose(np.array(in_volts.breaks), np.array(in_percent.breaks) * [1.0, 3.0], rtol=1e-9)
    assert in_volts.half_width_pct == pytest.approx(in_percent.half_width_pct, rel=1e-6)
    with pytest.raises(UsageError):
        plan_excitation(volts, NOISE, few, Limits(input=(30.0, 300.0)))


@pytest.mark.slow
def test_measured_widths_are_the_predicted_ones() -> None:
    found = plan_excitation(REFERENCE_PLANT, NOISE, WANT)
    rows = measure(found, REFERENCE_PLANT, NOISE, 5)
    for name, predicted in found.half_width_pct.items():
        # a prediction takes the noise at its lowest frequencies, and no width is known better than to a third
        assert 0.35 * predicted < np.median([row[name] for row in rows]) < 1.35 * predicted


@pytest.mark.slow
def test_a_planned_sequence_is_worth_more_than_a_random_one() -> None:
    judge = Judge(REFERENCE_PLANT, NOISE, WANT, Limits())
    start = judge.random(20, np.random.default_rng(3))
    assert judge.price(judge.improved(start)) < 0.5 * judge.price(start)


def test_scatter_between_engagements_asks_for_more_of_them() -> None:
    start = Judge(REFERENCE_PLANT, NOISE, {"Ts": 3.0}, Limits()).random(20, np.random.default_rng(3))
    few = Judge(REFERENCE_PLANT, NOISE, {"Ts": 3.0}, Limits()).engagements(start)
    many = Judge(REFERENCE_PLANT, Noise(1.8e-7, 6e-5, (0.03, 0.0, 0.0)), {"Ts": 3.0}, Limits()).engagements(start)
    assert few == 4 < many


@pytest.mark.slow
def test_simulated_recordings_scatter_from_engagement_to_engagement() -> None:
    """The gain of each engagement is its own, and the widths of a fit hold it."""
    calm, wild = (Noise(1.8e-7, 6e-5, (scatter, 0.0, 0.0)) for scatter in (0.0, 0.03))
    found = plan_excitation(REFERENCE_PLANT, wild, {"Ts": 4.0, "tau1": 8.0})
    assert found.engagements > 4
    gains = []
    for seed in range(3):
        run, same = (recording(found, REFERENCE_PLANT, disturbance_of(noise), seed) for noise in (wild, calm))
        starts = np.flatnonzero((run.input[1:] > 0) & (run.input[:-1] == 0))
        for first, last in zip(starts, [*starts[1:], len(run.input)], strict=True):
            part = slice(first, last)
            gains.append(float(run.output[part] @ same.output[part] / (same.output[part] @ same.output[part])))
    assert np.std(gains) == pytest.approx(0.03, rel=0.4)
    widths = [np.median([row["Ts"] for row in measure(found, REFERENCE_PLANT, noise, 3)])
              for noise in (calm, wild)]  # fmt: skip
    assert widths[1] > 1.5 * widths[0]


def test_limits_that_mean_nothing_are_refused() -> None:
    for limits, want in (
        (Limits(input=(50.0, 20.0)), WANT),
        (Limits(hold_s=(3.0, 1.0)), WANT),
        (Limits(), {"x": 1}),
    ):
        with pytest.raises(UsageError):
            plan_excitation(REFERENCE_PLANT, NOISE, want, limits)


def test_widths_that_scatter_keeps_out_of_reach_are_refused_at_once() -> None:
    """Sixty engagements leave t(59)/√60 = 0.258 of a scatter of 13 %, which is 3.4 %."""
    wild = Noise(1.8e-7, 6e-5, (0.13, 0.0, 0.0))
    refuse_scattered(wild, {"Ts": 3.5, "tau2": 1.0})
    with pytest.raises(UsageError, match=r"3\.42 %"):
        refuse_scattered(wild, {"Ts": 3.4})


def test_a_long_sequence_is_improved_within_a_bounded_effort(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    monkeypatch.setattr(Judge, "price", lambda self, sequence: float(asked.append(len(sequence.hold_s)) or 1.0))  # type: ignore[func-returns-value]
    judge = Judge(REFERENCE_PLANT, NOISE, WANT, Limits())
    for segments in (16, 600):
        asked.clear()
        judge.improved(judge.random(segments, np.random.default_rng(1)))
        assert 0 < sum(asked) < 1.05 * EFFORT
