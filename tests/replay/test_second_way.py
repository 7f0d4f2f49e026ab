"""The whole rig written again: absolute instants, a plant of exponentials, laws of their own."""

import math
from fractions import Fraction

import numpy as np
import pytest
from scipy.optimize import brentq

import eaid

DT = 1e-3
LIMITS = (0.0, 100.0)


class Plant:
    """Eqs. (4)-(7) and specification 4.2, from the plain numbers of fit.json."""

    def __init__(self, model, release=None, every_fall=False):
        self.model, self.release, self.every_fall, self.x = model, release, every_fall, (0.0, 0.0)

    def at(self, u):
        """τ1, τ2 [s] and T_s [N·m] of a rise, and how far u is up from rest to the lowest duty."""
        m, (low, high) = self.model, self.model.u_range
        inside = min(max(u, low), high)
        tau1, tau2, steady = (sum(c * inside**k for k, c in enumerate(part)) for part in (m.tau1, m.tau2, m.Ts))
        share = min(max(u / low, 0.0), 1.0)
        tau1 = max(tau1, 1e-3)
        return tau1, max(tau2, tau1), max(share * steady, 0.0), share

    def pull(self, u, x):
        """Where each part goes [N·m], and its time constant [s]."""
        tau1, tau2, steady, share = self.at(u)
        parts, falls = [], self.release or (None, None)
        for x_i, C, tau, fall in zip(x, (self.model.C, 1 - self.model.C), (tau1, tau2), falls, strict=True):
            if fall is not None and C * steady < x_i:
                tau = fall if self.every_fall else share * tau + (1 - share) * fall
            parts.append((C * steady, tau))
        return parts

    def after(self, u, seconds, x):
        parts = zip(x, self.pull(u, x), strict=True)
        return tuple(end + (x_i - end) * math.exp(-seconds / tau) for x_i, (end, tau) in parts)

    def hold(self, u, seconds):
        self.x = self.after(u, seconds, self.x)


def wound(q, e, wanted, limits):
    """The duty within its limits, and the integral, held while it would wind up."""
    duty = min(max(wanted, limits[0]), limits[1])
    return duty, q if (wanted - duty) * e > 0 else q + DT * e


class Law:
    """One controller by its printed formula."""

    def __init__(self, name, fit, gains, limits=LIMITS, falls=()):
        self.name, self.gains, self.limits, self.falls, self.q = name, gains, limits, falls, 0.0
        self.line, self.fit = fit.linear, fit
        self.seen, self.lack, self.last = (0.0, 0.0), 0.0, 0.0  # of the inverse

    def __call__(self, r, rate, torque):
        e = r - torque
        if self.name == "rc":
            return self.robust(r, rate, torque, e)
        if self.name == "inverse":
            return self.inverse(r, rate, torque)
        pi, line = self.gains.pi, self.line
        wanted = pi.K_P * e + pi.K_I * self.q if self.name == "pi" else (line.a0 * r - line.c0) / line.b0
        duty, self.q = wound(self.q, e, wanted, self.limits)
        return duty

    def robust(self, _r, rate, torque, e):
        rc, line, q = self.gains.rc, self.gains.model, self.q
        z = rc.Q[1][0] * q + rc.Q[1][1] * e
        rho = rc.rho.constant + rc.rho.slope * math.hypot(q, e)
        S = (math.tanh(rc.gamma * (abs(z) - rc.epsilon)) + 1) / 2
        omega = S * rho * math.copysign(1, z) + (1 - S) * rho * z / rc.epsilon
        y = rate + rc.K_D * e + rc.K_P * q + omega
        wanted = rc.B_hat * y + (line.a0 * torque - line.c0) / line.b0
        duty, self.q = wound(q, e, wanted, self.limits)
        return duty

    def inverse(self, r, rate, torque):
        """T⁺(u) = T_d(t_{k+1}) on the model, by Brent; an observer with both poles at e^(−30 dt)."""
        plant, kept, x = Plant(self.fit.nonlinear, *self.falls), math.exp(-30 * DT), self.seen
        miss = torque - sum(x)
        x = tuple(x_i + C * (1 - kept**2) * miss for x_i, C in zip(x, (plant.model.C, 1 - plant.model.C), strict=True))
        self.lack += (1 - kept) ** 2 / DT * miss
        wanted = r + (rate - self.lack) * DT
        short = [sum(plant.after(u, DT, x)) - wanted for u in LIMITS]
        duty = LIMITS[0] if short[0] > 0 else LIMITS[1] if short[1] < 0 else (
            brentq(lambda u: sum(plant.after(u, DT, x)) - wanted, *LIMITS, xtol=1e-13))  # fmt: skip
        x = plant.after(duty, DT, x)
        self.seen = (x[0] + self.lack * DT, x[1])
        return duty


def noise_of(rig, n, seed):
    return rig.get("noise_nm", 0.0) * np.random.default_rng(seed).standard_normal(n)


def second_way(plant, law, reference, rig, seed):
    """True, read and given at each sample: events on one absolute clock, in fractions of a second."""
    n, given, rows = len(reference), [], []
    rate = np.append(np.diff(reference) / DT, 0.0) if law.name == "inverse" else np.gradient(reference, DT)
    added, acting = noise_of(rig, n, seed), 0.0
    pulses = iter(Fraction(j, round(rig["pwm_hz"])) for j in range(10**6)) if rig.get("pwm_hz") else None
    pulse = next(pulses) if pulses else None
    for k, wanted in enumerate(reference):
        now, end = Fraction(k, 1000), Fraction(k + 1, 1000)
        true = sum(plant.x)
        duty = law(wanted, rate[k], true + added[k])
        given.append(duty)
        rows.append((true, true + added[k], duty))
        delay = rig.get("delay_samples", 0)
        ready = given[k - delay] if k >= delay else 0.0
        if pulse is None:
            plant.hold(ready, DT)
            continue
        while pulse < end:
            plant.hold(acting, float(pulse - now))
            now, acting, pulse = pulse, ready, next(pulses)
        plant.hold(acting, float(end - now))
    return np.array(rows).T


EFFECTS = {
    "bare": {},
    "noise": {"noise_nm": 0.03},
    "delay": {"delay_samples": 5},
    "latch": {"pwm_hz": 300.0},
    "fast latch": {"pwm_hz": 1700.0},
    "latch of the control rate": {"pwm_hz": 1000.0},
    "all": {"noise_nm": 0.02, "delay_samples": 2, "pwm_hz": 300.0},
}  # fmt: skip
STAIRS = np.repeat([0.0, 4.0, 0.5, 2.0, 0.3, 0.0], 150)
"""A staircase to the limits of the duty, and below the lowest identified one."""
WAVE = 1.5 + 1.2 * np.sin(2 * np.pi * 1.5 * np.arange(700) * DT)


def agrees(done, plant, law, reference, rig, seed=0):
    true, read, given = second_way(plant, law, reference, rig, seed)
    columns = done.records[law.name].columns
    np.testing.assert_allclose(columns["torque_nm"], true, atol=1e-11)
    np.testing.assert_allclose(columns["duty_pct"], given, atol=1e-8)
    if "noise_nm" in rig:
        np.testing.assert_allclose(columns["measured_nm"], read, atol=1e-11)
    else:
        assert "measured_nm" not in columns
    assert ("applied_pct" in columns) is bool({"delay_samples", "pwm_hz"} & set(rig))
    return columns


@pytest.mark.parametrize("name", EFFECTS)
def test_every_effect_of_the_rig_on_every_law(played, fit, gains, name):
    rig, names = EFFECTS[name], ("rc", "pi", "open-loop", "inverse")
    for reference in (STAIRS, WAVE):
        done = played(reference, controller=names, seed=11, **rig)
        for law in names:
            columns = agrees(done, Plant(fit.nonlinear), Law(law, fit, gains), reference, rig, 11)
            assert np.ptp(columns["duty_pct"]) > 30  # the loop was at work


RELEASE = {"tau1": 0.6, "tau2": 7.0}
FALL = {"from": 80.0, "level": 50.0, "Ts": 1.0, "tau1": 0.6, "tau2": 7.0}


@pytest.mark.parametrize("every", [False, True])
def test_falls_have_the_constants_of_the_release(played, fit_of, gains, every):
    """Below the lowest duty along the line of the torque; every fall where falls were recorded that are as quick."""
    fit = fit_of(release=RELEASE, friction={"levels": [FALL]} if every else None)
    assert fit.plant.falls_as_release is every
    falls = (0.6, 7.0), every
    done = played(STAIRS, fit=fit, controller=("pi", "inverse"))
    for law in ("pi", "inverse"):
        agrees(done, Plant(fit.nonlinear, *falls), Law(law, fit, gains, falls=falls), STAIRS, {})


def test_floors_hold_for_a_plant_that_breaks_them(played, fit_of, gains):
    """Within a thousandth τ2 may lie below τ1, and T_s below 0 at the lowest duties: then τ2 = τ1, T_s = 0."""
    fit = fit_of({"tau1": [3.002, 0, 0], "tau2": [3.0, 0, 0], "Ts": [-0.43, 0.043, 0, 0]})
    done = played(STAIRS, fit=fit, controller=("pi",))
    agrees(done, Plant(fit.nonlinear), Law("pi", fit, gains), STAIRS, {})


def test_narrower_limits(played, fit):
    gains = eaid.tune_rc(fit, duty_limits=(5.0, 80.0))
    done = played(STAIRS, gains=gains, controller=("rc", "pi", "open-loop"))
    for law in ("rc", "pi", "open-loop"):
        columns = agrees(done, Plant(fit.nonlinear), Law(law, fit, gains, (5.0, 80.0)), STAIRS, {})
        assert columns["duty_pct"].min() >= 5.0 and columns["duty_pct"].max() == 80.0


def test_the_inverse_leaves_no_steady_error_on_a_plant_that_it_does_not_know(played, fit_of):
    sd = np.array([0.005, 0.05, 0.01, 0.05, 0.5, 0.1, 0.001, 0.02, 0.05, 0.02])
    drawn = fit_of({"covariance": {"matrix": np.diag(sd**2).tolist()}})
    done = played(np.full(6000, 2.0), fit=drawn, controller=("inverse",), plants=6)
    lowest, *_, highest = done.records["inverse"].tables["plants/band_nm"]
    assert np.ptp([lowest, highest], axis=0).max() > 0.01  # at first
    assert abs(lowest[-1] - 2.0) < 1e-4 and abs(highest[-1] - 2.0) < 1e-4


def test_the_inverse_follows_exactly_what_the_duty_can_reach(played):
    t = np.arange(8000) * DT
    reachable = 1.5 * (1 - np.cos(2 * np.pi * 0.1 * np.maximum(t - 1, 0))) + 0.05 * np.minimum(t, 1)
    done = played(reachable, controller=("inverse",)).records["inverse"].columns
    settled = (done["duty_pct"] > 0) & (done["duty_pct"] < 100) & (t > 1)
    assert settled.mean() > 0.8
    assert np.abs(done["reference_nm"] - done["torque_nm"])[1:][settled[:-1]].max() < 1e-10
