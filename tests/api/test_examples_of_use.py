"""Rigs and logs as people have them, and what is made of them: each of these once went wrong."""

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

import eaid

from ..conftest import codes

TAU1, TAU2, RELEASE = 0.4, 3.0, 0.3


def frame(t, u, y, output="torque_nm"):
    return pd.DataFrame({"time_s": t, "duty_pct": np.asarray(u, float), output: y})


def rise(since, tau1=TAU1, tau2=TAU2):
    late = np.maximum(since, 0.0)
    return 1 - 0.85 * np.exp(-late / tau1) - 0.15 * np.exp(-late / tau2)


def steady(u):
    return 5e-4 * u**2 + 0.01 * u


def step(u, seed, hold_s=8.0, tau2=TAU2, release_s=0.0):
    """A run of 2 s of rest, a hold and a release; 2 % of scatter in its gain, 0.003 N·m of noise."""
    draw, t = np.random.default_rng([seed, int(u)]), np.arange(0.0, 2 + hold_s + release_s, 0.02)
    y = np.where(t < 2 + hold_s, rise(t - 2, tau2=tau2), np.exp(-np.maximum(t - 2 - hold_s, 0) / RELEASE))
    y = steady(u) * (1 + 0.02 * draw.normal()) * y + 0.003 * draw.normal(size=t.size)
    return frame(t, np.where((t >= 2) & (t < 2 + hold_s), u, 0.0), y)


def held(levels, hold_s, rate_hz, dead_s, tau1, tau2, gain):
    """Levels held one after the other, and the output that they leave, each rising from the tail of the one before."""
    rows = round(hold_s * rate_hz)
    t = np.arange(rows * len(levels)) / rate_hz
    changes = np.diff([gain(u) for u in levels], prepend=0.0)
    y = sum(change * rise(t - k * rows / rate_hz - dead_s, tau1, tau2) for k, change in enumerate(changes))
    return t, np.repeat(levels, rows), y


@pytest.mark.slow
def test_a_level_whose_tau2_is_open_keeps_its_torque_and_all_that_follows_goes_on():
    levels = (10.0, 32.0, 55.0, 78.0, 100.0)
    fit = eaid.fit({f"u{u:g}r{k}": step(u, k, 1.5 if u == 10 else 8.0) for u in levels for k in range(3)})
    assert fit.verdict.usable
    low = fit.at(10.0).loc["Ts"]
    assert low["value"] == pytest.approx(steady(10.0), rel=0.1) and low["low"] < steady(10.0) < low["high"]
    assert any(10.0 in one.levels for one in fit.findings if one.code == "tau2-outlasts-record")
    assert eaid.tune_rc(fit).margins.worst["rc"].stable
    assert len(eaid.plan(fit, want="Ts=5,tau1=10", check=False).levels) >= 4


@pytest.mark.slow
def test_a_good_log_of_several_levels_is_stopped_by_no_step_that_its_noise_hides():
    t, u, y = held((0.0, 40.0, 90.0, 60.0, 62.0, 20.0), 3.0, 20.0, 0.0, TAU1, TAU2, steady)
    noise = lfilter([0.43], [1, -0.9], np.random.default_rng(2).normal(size=t.size))  # remembers 0.5 s
    fit = eaid.fit(frame(t, u, y + 0.06 * noise), ci="none", shape="two")
    assert fit.recorded is not None and fit.nonlinear.fit_pct > 95
    assert "shape-explains-little" not in codes(fit) and min(one.R2 for one in fit.steps) < 0.3  # the log is explained
    assert fit.verdict.usable and "NOT USABLE" not in fit.summary() and eaid.tune_rc(fit).not_usable is None


def test_a_heaters_dead_time_is_the_rigs_and_its_loops_keep_their_margins():
    """Once "an input noted early, do not use", while the single steps had it right."""
    t, u, y = held((0.0, 40.0, 80.0, 20.0, 100.0), 350.0, 0.25, 16.0, 40.0, 200.0, lambda u: 0.35 * u)
    fit = eaid.fit(frame(t, u, y + 0.03 * np.random.default_rng(0).normal(size=t.size), "output (K)"), ci="none")
    assert fit.recorded is not None and fit.verdict.usable
    assert fit.dead_time_s == pytest.approx(16.0, abs=0.05) and codes(fit)["dead-time"].severity == "note"
    assert "input-late" not in codes(fit) and [one.dead_time_s for one in fit.steps] == pytest.approx([16.0] * 4, abs=1)
    assert fit.at(100.0).loc["Ts", "value"] == pytest.approx(35.0, rel=0.02)
    assert "shown  single steps" not in fit.summary()  # its levels, not each step by itself
    gains = eaid.tune_rc(fit, rate_hz=10.0)
    assert gains.margins.timing.delay_s == pytest.approx(fit.dead_time_s)
    for point in gains.margins.points:
        assert point.loops["pi"].stable and point.loops["pi"].gain_db >= 6 and point.loops["pi"].phase_deg >= 45


def test_small_commands_of_a_closed_loop_are_commands(small_fit, tmp_path):
    """Once set to 0 before the first above half a percent: 0.3 to 1.3 % off T_s, held by 54 % of its intervals."""
    t = np.arange(0.0, 20.0, 0.01)
    wanted = np.where(t < 1, 0.003 * t, np.repeat([0.3, 1.0, 2.0, 0.6, 3.0, 1.5, 0.2, 2.5, 1.0, 3.5], 200))
    pd.DataFrame({"time_s": t, "reference_nm": wanted}).to_csv(tmp_path / "wanted.csv", index=False)
    gains = eaid.tune_rc(small_fit, rate_hz=100.0)
    run = eaid.simulate(small_fit, gains, reference=tmp_path / "wanted.csv", controller=("pi",)).records["pi"].columns
    u, known = run["duty_pct"], small_fit.at(20.0)["value"]
    assert (u[1:90] > 0).all() and (u[:90] < 0.005 * u.max()).all()
    log = frame(run["time_s"], u, run["torque_nm"]).assign(reference_nm=run["reference_nm"])
    fit = eaid.fit(log, model=("nonlinear",), ci="none", duty=(20.0, 100.0))
    assert fit.recorded.loops and fit.at(20.0)["value"].to_numpy() == pytest.approx(known.to_numpy(), rel=1e-4)


@pytest.mark.parametrize("hold_s", [3.0, 7.0])  # 1.5 and 3.5 τ2
def test_steps_between_levels_carry_the_tail_of_the_step_before(hold_s):
    """`change` was held by 11 to 42 % of 95 % intervals at 3.5 τ2."""
    gain = {20.0: 0.6, 50.0: 1.8, 80.0: 2.4, 40.0: 0.4}.__getitem__
    t, u, y = held((20.0, 50.0, 80.0, 40.0), hold_s, 50.0, 0.0, 0.3, 2.0, gain)
    y += gain(20.0) * (1 - rise(t, 0.3, 2.0))  # at rest on its first level
    log = frame(t, u, y + 0.003 * np.random.default_rng(1).normal(size=t.size))
    fit = eaid.fit(eaid.read(log, logs_as="steps"))
    assert [(one.from_, one.level) for one in fit.steps] == [(20.0, 50.0), (50.0, 80.0), (80.0, 40.0)]
    for one in fit.steps:
        true = gain(one.level) - gain(one.from_)
        assert one.change == pytest.approx(true, rel=0.03)
        if hold_s > 4 or one.ci95.change is not None:
            assert one.ci95.change[0] < true < one.ci95.change[1]
    assert fit.steps[1].tail


def test_a_recorded_fit_keeps_its_rig_and_honours_or_refuses_what_is_asked_of_it():
    t, u, y = held((0.0, 40.0, 80.0, 20.0, 100.0, 60.0), 4.0, 25.0, 0.0, TAU1, TAU2, steady)
    log = frame(t, u, y + 0.003 * np.random.default_rng(0).normal(size=t.size))
    logs = eaid.read(log, apparatus="surfaces=4,sample_rate_hz=250")
    asked = {"ci": "none", "bounds_levels": "40:100", "shape": "two", "dead_time": 0.0}
    fit, joint = (eaid.fit(logs, estimator=name, **asked) for name in ("auto", "joint"))
    assert fit.recorded is not None and fit.data.apparatus.surfaces == 4
    assert eaid.tune_rc(fit).margins.timing.rate_hz == 250.0
    assert joint.nonlinear.estimator == fit.nonlinear.estimator == "joint" and joint.params.equals(fit.params)
    assert min(fit.linear.bounds.levels) == 40.0 and fit.conf_int().isna().all(axis=None)
    with pytest.raises(eaid.UsageError, match="ci= bootstrap: logs fitted as recorded take robust or none"):
        eaid.fit(logs, ci="bootstrap")
    with pytest.raises(eaid.UsageError, match="duty= 1000: the fit knows 20 … 100 % only"):
        fit.predict(1000, [1.0])
    assert fit.predict(80, [100.0]).iloc[0, 0] == pytest.approx(steady(80.0), rel=0.02) and fit.plot().lines
