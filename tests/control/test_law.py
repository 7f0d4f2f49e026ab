"""The robust law as one pure step: what is printed, without its jump; and what the guarantee promises of it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eaid.control.gains import law_of
from eaid.control.rc import rc_step

small = st.floats(-3, 3, allow_subnormal=False)
DT = 1e-3
SECONDS = 3.0


@pytest.fixture(scope="module")
def RC(tuned):
    return law_of(tuned(), "rc")._replace(duty_min=-math.inf, duty_max=math.inf)


def omega_of(gains, integral, error):
    """ω [N·m/s], from a law that is nothing but ω."""
    bare = gains._replace(K_P=0.0, K_D=0.0, B_hat=1.0, a0=0.0, c0=0.0)
    return rc_step(bare, integral, error, 0.0, 0.0, DT)[1]


@pytest.mark.parametrize("gamma", [0.5, 2.0, 10.0, 50.0])
@given(small, small)
def test_omega_is_odd_and_has_no_jump(RC, gamma, integral, error):
    gains = RC._replace(gamma=gamma)
    there, back = omega_of(gains, integral, error), omega_of(gains, -integral, -error)
    assert back == pytest.approx(-there, rel=1e-12, abs=1e-12)
    if gamma >= 2:
        assert abs(there) <= 1.3 * (gains.rho_constant + gains.rho_slope * math.hypot(integral, error))
    assert omega_of(gains, 0.0, 0.0) == 0.0
    assert all(abs(omega_of(gains, 0.0, e)) < 100 * e for e in (1e-6, 1e-9, 1e-12))


def test_omega_exceeds_rho_by_six_in_a_thousand_at_the_edge_of_the_layer(RC):
    errors = np.linspace(0.4, 0.6, 2001).tolist()
    shares = [omega_of(RC, 0.0, e) / (RC.rho_constant + RC.rho_slope * e) for e in errors]
    assert max(shares) == pytest.approx(1.006, abs=1e-3)
    far = RC._replace(rho_slope=0.0)
    assert omega_of(far, 0.0, 1.0) == far.rho_constant == -omega_of(far, 0.0, -1.0)


def run(gains, Q, b, mismatch, reference, start_nm):
    """ξ, z and V along Ṫ = b (u − η̂(T) − δ), δ = mismatch(t, z), b = b(t): exact while u, δ, b are held."""
    state, torque, rows = 0.0, start_nm, []
    rate = np.gradient(reference, DT)
    pole = gains.a0 / gains.b0
    for k, (r, slope) in enumerate(zip(reference.tolist(), rate.tolist(), strict=True)):
        error = r - torque
        z = gains.Q12 * state + gains.Q22 * error
        xi = np.array([state, error])
        rows.append((state, error, z, float(xi @ Q @ xi)))
        state, duty = rc_step(gains, state, r, slope, torque, DT)
        gain = b(k * DT)
        a = gain * pole
        drive = gain * (duty + gains.c0 / gains.b0 - mismatch(k * DT, z))
        torque = torque - math.expm1(-a * DT) * (drive / a - torque)
    return np.array(rows)


def smooth_reference(random, Q_M):
    """Three sines around 2 N·m whose slope reaches, and never exceeds, Q_M."""
    t = np.arange(0, SECONDS, DT)
    f, phase, size = random.uniform(0.2, 3, 3), random.uniform(0, 2 * math.pi, 3), random.uniform(0.1, 1, 3)
    wave = (size[:, None] * np.sin(2 * math.pi * f[:, None] * t + phase[:, None])).sum(axis=0)
    return 2 + wave * Q_M / np.abs(np.gradient(wave, DT)).max()


def random_plant(random, phi_pct):
    """b inside its range (constant, or swinging over it), |δ| ≤ φ (the worst sign, a constant, or a swing)."""
    low, high = 1 / 42.6, 1 / 12.4
    level, swing, rate = random.uniform(low, high), random.random() < 0.5, random.uniform(0.2, 5)

    def b(t):
        return (low + high) / 2 + (high - low) / 2 * math.sin(rate * t) if swing else level

    kind, share = random.integers(3), random.uniform(-1, 1)

    def mismatch(t, z):
        if kind == 0:
            return phi_pct * math.copysign(1, z)
        return phi_pct * (share if kind == 1 else math.sin(7 * rate * t))

    return b, mismatch


@pytest.fixture(scope="module")
def guaranteed(tuned):
    def guaranteed(**options):
        made = tuned(b_hat="minimax", **options)
        assert made.rc.rho_covers
        return made.rc, law_of(made, "rc")._replace(duty_min=-math.inf, duty_max=math.inf)

    return guaranteed


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"rho": "textbook", "phi": 20.0}, {"epsilon": 0.2, "p_scale": 2.0}])
def test_V_falls_outside_the_layer_on_100_random_plants(guaranteed, options):
    rc, gains = guaranteed(**options)
    random = np.random.default_rng(20221110)
    outside, worst_end = 0, 0.0
    for _ in range(100):
        b, mismatch = random_plant(random, rc.phi_honest_pct)
        rows = run(gains, np.array(rc.Q), b, mismatch, smooth_reference(random, rc.Q_M), random.uniform(-4, 4))
        out = np.abs(rows[:-1, 2]) > gains.epsilon
        assert (np.diff(rows[:, 3])[out] <= 0).all()
        outside += int(out.sum())
        worst_end = max(worst_end, np.abs(rows[-1000:, 1]).max())
    assert outside > 1000
    if not options:  # docs/robust-control.md
        assert outside == pytest.approx(7909, abs=5) and worst_end == pytest.approx(0.228, abs=5e-4)


def test_with_the_real_limits_V_rises(guaranteed):
    """The stated counter-example: b at its least, η above η̂ by φ, a ramp of Q_M from 2 N·m at 0…100 % duty."""
    rc, free = guaranteed()
    Q = np.array(rc.Q)
    ramp = (lambda _: 1 / 42.6, lambda _t, _z: rc.phi_honest_pct, 2 + rc.Q_M * np.arange(0, 0.4, DT), 2.0)
    held = run(free._replace(duty_min=0.0, duty_max=100.0), Q, *ramp)
    out = np.abs(held[:-1, 2]) > free.epsilon
    assert out.any() and (np.diff(held[:, 3])[out] > 0).all()
    assert int(np.flatnonzero(out)[0]) == 103  # [ms], docs/robust-control.md
    assert np.abs(held[:, 1]).max() == pytest.approx(1.91, abs=5e-3)
    # The same plant and reference without limits: never outside the layer, V bounded.
    unlimited = run(free, Q, *ramp)
    assert (np.abs(unlimited[:, 2]) <= free.epsilon).all()
    assert np.abs(unlimited[:, 1]).max() == pytest.approx(0.24, abs=5e-3)
