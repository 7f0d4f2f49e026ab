from dataclasses import replace

import msgspec
import numpy as np
import pytest
from scipy.stats import chi2

import eaid
from eaid.estimate.scatter import unit_variances
from eaid.estimate.spread import t_quantile
from eaid.options import PlanOptions
from eaid.planning.widths import KEPT_SHARES, fitted_rig
from eaid.plant.dynamics import REFERENCE_PLANT, Plant, Step
from eaid.plant.respond import respond
from eaid.results.fit import Fit
from eaid.results.models import FittedData, Friction, FrictionLevel, Noise, Uncertainty
from eaid.results.plant import FittedPlant


def curve_at(duty: float) -> Step:
    return REFERENCE_PLANT.at(duty)


def test_widths_of_pure_scatter_by_hand() -> None:
    """No noise within a run: that share of sessions shows less than t σ/√R √(χ²/ν) at their worst of three levels."""
    levels, spread = [20.0, 50.0, 80.0], np.array([0.03, 0.05, 0.1])
    rows = tuple(
        FrictionLevel(u, **{name: getattr(curve_at(u), name) for name in ("Ts", "tau1", "tau2")}) for u in levels
    )
    noise = Noise(0.0, 0.0, dict(zip(("Ts", "tau1", "tau2"), spread.tolist(), strict=True)))
    fit = Fit(data=FittedData(kind="friction-speed"), friction=Friction(levels=rows))
    rig = replace(fitted_rig(fit), noise=noise, known=False)
    found = rig.kept(*rig.contributions(levels, np.full(3, 30.0), PlanOptions()), 9, levels)
    one = chi2(8).ppf(np.array(KEPT_SHARES) ** (1 / 3)) / 8  # each level by itself, nine runs; the worst of three
    expected = 100 * np.expm1(t_quantile(8) * spread * np.sqrt(one) / 3)
    np.testing.assert_allclose(list(found.values()), expected, rtol=0.05)
    sure = replace(rig, known=True, fit=msgspec.structs.replace(fit, uncertainty=Uncertainty(degrees_of_freedom=20.0)))
    wider = sure.kept(*sure.contributions(levels, np.full(3, 30.0), PlanOptions()), 9, levels)
    assert all(1.02 < wider[name] / found[name] < 1.25 for name in found)  # the scatter itself is known by 20


def test_information_is_the_sum_over_samples() -> None:
    from eaid.estimate.scatter import log_jacobian

    t = (np.arange(40_000) + 0.5) * 1e-3
    J = log_jacobian(curve_at(50.0), t)
    inverse = np.linalg.inv(J.T @ J * 1e-3)
    found = unit_variances(curve_at(50.0), 40.0)
    assert found[:, 0] == pytest.approx(np.diag(inverse), rel=1e-2)
    scores = inverse @ (J.T * J[:, 0]) * np.sqrt(1e-3)  # noise of density 1 times the torque itself
    assert found[:, 1] == pytest.approx((scores**2).sum(axis=1), rel=1e-2)


KINDS = {
    "lag": Plant((0.5,), (0.5,), (0.0, 0.02), (10.0, 100.0), 1.0),
    "lag, late": Plant((0.5,), (0.5,), (0.0, 0.02), (10.0, 100.0), 1.0, dead_time_s=0.2),
    "overshoot": Plant((0.2,), (1.5,), (0.0, 0.02), (10.0, 100.0), 1.6),
    "series": Plant((0.4,), (0.4,), (0.0, 0.02), (10.0, 100.0), 1.0, zeta=1.6),
    "ringing": Plant((0.1,), (0.1,), (0.0, 0.02), (10.0, 100.0), 1.0, zeta=0.3),
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_session_is_planned_of_every_kind(kind: str) -> None:
    fit = Fit(data=FittedData(levels=(10.0, 100.0)), plant_=FittedPlant.of(KINDS[kind], ("%", "N·m")))
    session = eaid.plan(fit, check=False, most_levels=8)
    assert session.met and tuple(session.half_width_pct) == fitted_rig(fit).numbers
    assert min(session.half_width_pct.values()) > 0


@pytest.mark.parametrize("kind", KINDS)
def test_simulated_sessions_of_every_kind_tell_what_information_does(kind: str) -> None:
    """Of one lag they told ten times less: their inputs changed between two rows, and were noted late."""
    noise = Noise(1e-6, 1e-6, {"Ts": 0.01, "tau1": 0.0, "tau2": 0.0})
    plant = FittedPlant.of(replace(KINDS[kind], tau1=(0.997 * KINDS[kind].tau1[0],)), ("%", "N·m"))
    fit = Fit(data=FittedData(levels=(10.0, 100.0)), plant_=plant, uncertainty=Uncertainty(noise=noise))
    simulated, informed = (eaid.plan(fit, check=check, most_levels=8) for check in (True, False))
    assert (simulated.repeats, simulated.hold_s) == (informed.repeats, informed.hold_s)
    for name, width in informed.half_width_pct.items():
        assert 0.4 < simulated.half_width_pct[name] / width < 2.5, name


@pytest.mark.parametrize("kind", KINDS)
def test_information_of_every_kind_is_that_of_finite_differences(kind: str) -> None:
    """Variances by white noise of two steps, their idle and release, by differences of `respond`."""
    plant, noise = KINDS[kind], Noise(1e-4, 0.0, {"Ts": 0.0, "tau1": 0.0, "tau2": 0.0})
    fit = Fit(data=FittedData(levels=(50.0, 100.0)), plant_=FittedPlant.of(plant, ("%", "N·m")))
    rig = replace(fitted_rig(fit), noise=noise, known=False)
    within, _ = rig.contributions([50.0, 100.0], np.full(2, 6.0), PlanOptions(idle_s=2.0, release_s=5.0))
    t = np.arange(0.0, 26.0, 1e-3)

    def output(logs: np.ndarray) -> np.ndarray:
        gain, one, *more = np.exp(logs[:-1]).tolist()
        own = replace(plant, Ts=(0.0, 0.02 * gain), tau1=(one,))
        if plant.kind == "overshoot":
            own = replace(own, tau2=(more[0],), C=0.6 + more[1])
        if plant.kind == "series":
            own = replace(own, tau1=((one * more[0]) ** 0.5,), zeta=(one + more[0]) / (2 * (one * more[0]) ** 0.5))
        if plant.kind == "ringing":
            own = replace(own, tau1=(1 / one,), zeta=more[0])
        if plant.dead_time_s:
            own = replace(own, dead_time_s=more[0])
        return respond(own, [0.0, 2.0, 8.0, 15.0, 21.0], [0.0, 50.0, 0.0, 100.0, 0.0], t) + logs[-1]

    one, two = (float(tau) for tau in plant.time_constants(50.0))
    more = {"lag": [], "overshoot": [two, 1.0], "series": [two], "ringing": [plant.zeta]}[plant.kind]
    first = 1 / plant.tau1[0] if plant.kind == "ringing" else one
    late = [plant.dead_time_s] * bool(plant.dead_time_s)
    x = np.append(np.log([1.0, first, *more, *late]), 0.0)
    J = np.array([(output(x + step) - output(x - step)) / 2e-5 for step in 1e-5 * np.eye(len(x))]).T
    expected = 1e-4 * np.diag(np.linalg.inv(J.T @ J * 1e-3))[: within.shape[0]]
    np.testing.assert_allclose(within.sum(axis=2)[:, 1], expected, rtol=0.1)


@pytest.mark.parametrize(("share", "tau2_s"), [(1.0, 171.0), (0.85, 400.0)])
def test_a_rig_of_minutes_is_held_and_rests_for_as_long_as_it_takes(share: float, tau2_s: float) -> None:
    """A heater: 171 s behind a dead time of 152; the paper's clutch keeps its 120 s, and rests until what the highest
    level leaves is little beside the lowest, a minute at most."""
    rests_s = 10 if share == 1 else 50  # a minute with the idle time
    slow = Plant((171.0,), (tau2_s,), (0.0, 0.02), (10.0, 100.0), share, dead_time_s=152.0)
    quick, how = replace(slow, tau1=(0.5,), tau2=(16.0,), dead_time_s=0.0), {"check": False, "most_levels": 4}
    for plant, release_s, least, most in ((slow, 152 + 5 * 171, 152 + 171, 152 + 5 * 171), (quick, rests_s, 0, 120)):
        fit = Fit(data=FittedData(levels=(10.0, 100.0)), plant_=FittedPlant.of(plant, ("%", "degC")))
        for run in eaid.plan(fit, **how).runs:
            assert run.release_s == release_s and least < run.hold_s <= most
    assert {run.release_s for run in eaid.plan(fit, release_s=7.0, **how).runs} == {7.0}
    with pytest.raises(eaid.UsageError, match="longest_hold_s= 100: the output answers after 152 s"):
        eaid.plan(Fit(data=fit.data, plant_=FittedPlant.of(slow, ("%", "degC"))), longest_hold_s=100.0, **how)
