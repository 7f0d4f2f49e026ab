"""What the guarantee promises: V falls outside the layer on 100 random linear plants; and where it stops doing so."""

import math

import numpy as np
import pytest

from eaid.control import robust
from eaid.control.design import design
from eaid.control.gains import rc_gains
from eaid.control.options import DesignOptions
from eaid.control.rc import RCState, rc_step, rc_terms
from eaid.control.rc_design import Disturbance, error_bound, solve_Q, ultimate_level
from eaid.results.codec import from_plain, to_plain
from eaid.results.fit import Fit

FIT = {"linear": {"a0": 1.36, "b0": 0.08, "c0": -2.42, "bounds": {"B_m": 12.4, "B_M": 42.6}}}
DT = 1e-3
SECONDS = 3.0


def run(gains, Q, b, mismatch, reference, start_nm):
    """ξ, z and V along Ṫ = b (u − η̂(T) − δ), δ = mismatch(t, z), b = b(t): exact while u, δ, b are held."""
    state, torque, rows = RCState(0.0), start_nm, []
    rate = np.gradient(reference, DT)
    pole = gains.a0 / gains.b0
    for k, (r, slope) in enumerate(zip(reference.tolist(), rate.tolist(), strict=True)):
        error = r - torque
        z = rc_terms(gains, state.integral, error).z
        xi = np.array([state.integral, error])
        rows.append((state.integral, error, z, float(xi @ Q @ xi)))
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


def free_design(**changes):
    made = design(from_plain(FIT, Fit, "f"), DesignOptions(B_hat="minimax", **changes))
    found = to_plain(made)
    assert found["rc"]["guaranteed"]
    return found, rc_gains(made)._replace(duty_min=-math.inf, duty_max=math.inf)


@pytest.mark.slow
@pytest.mark.parametrize("changes", [{}, {"reading": "textbook", "phi": 20.0}, {"epsilon": 0.2, "p_scale": 2.0}])
def test_V_falls_outside_the_layer_on_100_random_plants(changes):
    found, gains = free_design(**changes)
    rc = found["rc"]
    Q = np.array(rc["Q"])
    random = np.random.default_rng(20221110)
    outside, worst_end = 0, 0.0
    for _ in range(100):
        b, mismatch = random_plant(random, rc["phi_honest_pct"])
        reference = smooth_reference(random, rc["Q_M"])
        rows = run(gains, Q, b, mismatch, reference, random.uniform(-4, 4))
        z, V = rows[:, 2], rows[:, 3]
        out = np.abs(z[:-1]) > gains.epsilon
        assert (np.diff(V)[out] <= 0).all()
        outside += int(out.sum())
        worst_end = max(worst_end, np.abs(rows[-1000:, 1]).max())
    assert outside > 1000
    # … and every error ends below the ultimate bound, which is not idle talk: some come within a factor of ten.
    bound = rc["ultimate_bound"]["torque_error_nm"]
    assert bound / 10 < worst_end < bound
    if not changes:  # docs/robust-control.md
        assert outside == pytest.approx(7909, abs=5) and worst_end == pytest.approx(0.228, abs=5e-4)


def test_with_the_real_limits_V_rises():
    """The stated counter-example: b at its least, η above η̂ by φ, a ramp of Q_M from 2 N·m at 0…100 % duty."""
    found, free = free_design()
    rc = found["rc"]
    limited = free._replace(duty_min=0.0, duty_max=100.0)
    Q = np.array(rc["Q"])
    reference = 2 + rc["Q_M"] * np.arange(0, 0.4, DT)
    ramp = (lambda _: 1 / 42.6, lambda _t, _z: rc["phi_honest_pct"], reference, 2.0)
    held = run(limited, Q, *ramp)
    out = np.abs(held[:-1, 2]) > limited.epsilon
    assert out.any() and (np.diff(held[:, 3])[out] > 0).all()
    assert int(np.flatnonzero(out)[0]) == 103  # [ms], docs/robust-control.md
    assert np.abs(held[:, 1]).max() == pytest.approx(1.91, abs=5e-3)
    # The same plant and reference without limits: never outside the layer, V bounded by the ultimate level.
    unlimited = run(free, Q, *ramp)
    assert (np.abs(unlimited[:, 2]) <= free.epsilon).all()
    assert np.abs(unlimited[:, 1]).max() == pytest.approx(0.24, abs=5e-3)


@pytest.mark.slow
def test_too_small_a_rho_fails():
    """A test of the test: with a tenth of ρ some plant makes V rise outside the layer."""
    found, gains = free_design()
    rc = found["rc"]
    weak = gains._replace(rho_constant=0.1 * gains.rho_constant, rho_slope=0.1 * gains.rho_slope)
    random = np.random.default_rng(20221110)
    rises = 0
    for _ in range(40):
        b, mismatch = random_plant(random, rc["phi_honest_pct"])
        rows = run(weak, np.array(rc["Q"]), b, mismatch, smooth_reference(random, rc["Q_M"]), 0.0)
        out = np.abs(rows[:-1, 2]) > weak.epsilon
        rises += int((np.diff(rows[:, 3])[out] > 0).sum())
    assert rises > 0


def brute_level(d, P, Q, reach):
    """The largest V with ξᵀPξ ≤ 2|z|(n − (1 − α) ρ min(1, |z|/ε)), on a fine grid."""
    side = np.linspace(-reach, reach, 1501)
    q, e = np.meshgrid(side, side)
    xi = np.stack([q, e])
    size = np.hypot(q, e)
    z = np.abs(Q[1, 0] * q + Q[1, 1] * e)
    quadratic = lambda M: np.einsum("ixy,ij,jxy->xy", xi, M, xi)  # noqa: E731
    push = d.n0 + d.n1 * size - (1 - d.alpha) * (d.rho0 + d.rho1 * size) * np.minimum(1, z / d.epsilon)
    return quadratic(Q)[quadratic(P) <= 2 * z * push].max()


@pytest.mark.slow
@pytest.mark.parametrize("reading", ["paper", "textbook"])
@pytest.mark.parametrize("epsilon", [0.05, 0.5])
def test_ultimate_level_is_what_a_grid_finds(epsilon, reading):
    alpha = robust.alpha_formula(12.4, 42.6)
    term = robust.uncertainty_term(reading, 0.05, 12.4, 42.6)
    norm_K = math.hypot(4.5, 3)
    rho = robust.rho(alpha, 5.0, norm_K, term)
    P = 5 * np.eye(2)
    Q = solve_Q(4.5, 3.0, P)
    d = Disturbance(alpha, alpha * 5 + term, alpha * norm_K, rho.constant, rho.slope, epsilon)
    level = ultimate_level(d, P, Q)
    reach = 1.5 * math.sqrt(level / np.linalg.eigvalsh(Q).min())  # half as wide again as the level set
    assert level == pytest.approx(brute_level(d, P, Q, reach), rel=0.03)


def test_no_bound_where_the_disturbance_outgrows_P():
    P = np.eye(2)
    Q = solve_Q(4.5, 3.0, P)
    wild = Disturbance(alpha=0.9, n0=1.0, n1=50.0, rho0=1.0, rho1=1.0, epsilon=0.5)
    assert ultimate_level(wild, P, Q) == math.inf and error_bound(math.inf, Q) == math.inf


def test_error_bound_touches_the_level_set():
    Q = solve_Q(4.5, 3.0, 5 * np.eye(2))
    angle = np.linspace(0, 2 * math.pi, 100001)
    unit = np.stack([np.cos(angle), np.sin(angle)])
    size = np.sqrt(2.0 / np.einsum("id,ij,jd->d", unit, Q, unit))
    assert error_bound(2.0, Q) == pytest.approx((size * unit[1]).max(), rel=1e-6)
