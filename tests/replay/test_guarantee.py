"""χ against ρ: the slope that was asked for minus the one that came, and whose fault it is."""

import numpy as np
import pytest

from eaid.replay import references
from eaid.replay.loop import replay
from eaid.replay.plant import plant_slope, plant_step
from eaid.replay.rig import Rig
from eaid.replay.simulate import Watch, watch
from eaid.results.replay import Metrics

DT = 1e-3


def test_chi_is_the_two_terms_of_the_book_where_the_duty_is_free(plant, law):
    """χ = (1 − b B̂) y + b (η − η̂) for any b, η with Ṫ = b u − b η: here by a plant line through two duties."""
    reference = references.multisine(DT, 6.0)
    rc = law("rc")
    done = replay(plant, rc, reference.torque_nm, Rig(), DT)
    seen = watch(rc.gains, plant, done)
    g = rc.gains
    free = np.flatnonzero(seen.limited == 0)[::97]
    torque, duty = done.torque_nm, done.duty_pct
    x1 = x2 = 0.0
    states = []
    for u in duty:
        states.append((x1, x2))
        x1, x2 = plant_step(plant, x1, x2, u, DT)
    assert len(free) > 30 and np.abs(seen.chi_nm_s[free]).max() > 1
    for k in free:
        u = duty[k]
        b = (plant_slope(plant, *states[k], u + 0.5) - plant_slope(plant, *states[k], u)) / 0.5
        eta = u - plant_slope(plant, *states[k], u) / b
        eta_hat = (g.a0 * torque[k] - g.c0) / g.b0
        y = (u - eta_hat) / g.B_hat
        # the slope's mean over a sample is the slope at its begin to first order
        assert seen.chi_nm_s[k] == pytest.approx((1 - b * g.B_hat) * y + b * (eta - eta_hat), rel=5e-3, abs=0.02)
    assert np.array_equal(seen.chi_unlimited_nm_s[free], seen.chi_nm_s[free])
    assert seen.rho_nm_s.min() >= g.rho_constant


@pytest.mark.slow
def test_on_steps_it_fails_at_the_limits_alone(plant, law):
    reference = references.steps(DT)
    done = replay(plant, law("rc"), reference.torque_nm, Rig(), DT)
    numbers = watch(law("rc").gains, plant, done).measured(Metrics())
    assert 0.98 < numbers.guarantee_holds_fraction < 1.0
    assert numbers.guarantee_failures_at_limit == 1.0
    assert 0.5 < numbers.guarantee_failures_by_saturation < 1.0
    assert numbers.guarantee_largest_chi_over_rho > 10


def test_without_limits_it_is_the_reference_steps_that_fail_no_more(plant, law):
    """The limits were the cause: with them lifted in the law, duty beyond them still does nothing in this plant."""
    reference = references.multisine(DT, 6.0)
    done = replay(plant, law("rc"), reference.torque_nm, Rig(saturation=False), DT)
    seen = watch(law("rc").gains, plant, done)
    assert seen.limited.max() == 0.0


def test_shares_by_hand():
    rho = np.full(4, 2.0)
    seen = Watch(
        np.array([1.0, -3.0, 5.0, -4.0]), rho, np.array([0.0, 0.0, 1.0, 1.0]), np.array([1.0, -3.0, 0.5, -4.0])
    )
    assert seen.measured(Metrics(rms_error_nm=0.5)) == Metrics(
        rms_error_nm=0.5,
        guarantee_holds_fraction=0.25,
        guarantee_largest_chi_over_rho=2.5,
        guarantee_failures_at_limit=pytest.approx(2 / 3),
        guarantee_failures_by_saturation=pytest.approx(1 / 3),
    )
    assert seen.measured(Metrics(), 3).guarantee_failures_at_limit == 1.0
    held = Watch(rho / 4, rho, np.zeros(4), rho / 4)
    assert held.measured(Metrics()).guarantee_failures_at_limit is None
