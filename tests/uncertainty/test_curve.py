import numpy as np
import pytest

from eaid.fitting.basis import basis_of, constraints
from eaid.models.parameters import REFERENCE_PLANT, Nonlinear
from eaid.uncertainty.curve import curve_of_single_runs, curve_with_repeats, powers, through
from eaid.uncertainty.joint import BLOCKS, coefficients_of, limits_of, with_joint_covariance
from eaid.uncertainty.nonlinear_intervals import two_stage
from eaid.uncertainty.runs import t_quantile

DUTY = np.arange(10.0, 101.0, 10.0)
TAU2 = np.polynomial.polynomial.polyval(DUTY, REFERENCE_PLANT.tau2)


def test_a_polynomial_comes_back_through_its_logarithms() -> None:
    found = through(DUTY, np.log(TAU2), np.full(10, 1e-4), 3)
    assert found == pytest.approx(np.array(REFERENCE_PLANT.tau2) * 100.0 ** np.arange(3), rel=1e-9)


def test_it_is_the_least_squares_of_logs() -> None:
    """Against a blind minimiser of the same sum."""
    from scipy.optimize import minimize

    random = np.random.default_rng(0)
    variance = np.linspace(1, 9, 10) * 1e-3
    theta = np.log(TAU2) + np.sqrt(variance) * random.standard_normal(10)

    def cost(c: np.ndarray) -> float:
        value = powers(DUTY, 3) @ c
        return float(((theta - np.log(value)) ** 2 / variance).sum()) if (value > 0).all() else 1e9

    ours = through(DUTY, theta, variance, 3)
    blind = minimize(cost, ours * 1.1, method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-12, "maxiter": 9999})
    assert cost(ours) <= blind.fun * (1 + 1e-9)


@pytest.mark.slow
def test_band_covers_and_misfit_is_told() -> None:
    random = np.random.default_rng(1)
    held, misfits = [], []
    for _ in range(300):
        theta = np.log(TAU2) + 0.05 * random.standard_normal(10)
        curve = curve_with_repeats(DUTY, theta, np.full(10, 0.05**2), 1e6, 3)
        reach = t_quantile(curve.degrees_at(DUTY)) * curve.log_sd(DUTY)
        held.append(np.abs(np.log(curve.at(DUTY) / TAU2)) <= reach)
        misfits.append(curve.misfit)
    assert 0.93 <= np.mean(held) <= 0.97
    assert np.mean(misfits) == pytest.approx(1, abs=0.1)


def test_a_curve_that_cannot_follow_is_wider() -> None:
    bent = np.log(TAU2) + 0.3 * np.sin(DUTY / 8)
    curve = curve_with_repeats(DUTY, bent, np.full(10, 1e-4), 20, 3)
    assert curve.misfit > 50
    straight = curve_with_repeats(DUTY, np.log(TAU2), np.full(10, 1e-4), 20, 3)
    assert curve.log_sd(DUTY[3:6]).min() > 5 * straight.log_sd(DUTY[3:6]).max()


@pytest.mark.slow
def test_single_runs_show_their_scatter_in_the_curve() -> None:
    random = np.random.default_rng(2)
    found = [
        curve_of_single_runs(DUTY, np.log(TAU2) + 0.1 * random.standard_normal(10), np.full(10, 1e-6), 3).between
        for _ in range(100)
    ]
    assert np.sqrt(np.mean(found)) == pytest.approx(0.1, rel=0.15)


def test_two_stage_keeps_the_constraints() -> None:
    theta = {"tau1": np.log(np.full(10, 0.5)), "tau2": np.log(np.linspace(0.52, 9, 10)), "Ts": np.log(DUTY / 30)}
    theta["tau2"][0] = np.log(0.1)  # noise has put τ2 below τ1 at the lowest level
    variance = {name: np.full(10, 1e-3) for name in theta}
    curves = {n: curve_with_repeats(DUTY, theta[n], variance[n], 20, 4 if n == "Ts" else 3) for n in BLOCKS}
    found = two_stage(DUTY, theta, variance, curves, np.eye(3), 0.85)
    rows, offset = limits_of(found.counts, found.u_range)
    assert (rows @ found.values - offset).min() > -1e-9
    assert found.constrained
    assert np.isfinite(found.covariance).all()


def test_joint_covariance_of_one_shifted_level_is_its_square() -> None:
    """Shift only the 50 % level's T_s: the covariance has rank one."""
    from eaid.fitting.data import data_of
    from eaid.models import nonlinear
    from eaid.steps.stepset import Level

    t = np.arange(400) * 0.05
    levels = [Level(u, t, nonlinear.step_response(REFERENCE_PLANT, t, u)[None], ("a",)) for u in DUTY]
    shifts = np.zeros((len(DUTY), 3, 3))
    shifts[4, 0, 0] = 1e-4
    c = with_joint_covariance(coefficients_of(REFERENCE_PLANT), data_of(levels), shifts)
    assert np.linalg.matrix_rank(c.covariance, tol=1e-10 * np.abs(c.covariance).max()) == 1
    assert c.log_sd("Ts", DUTY)[4] > 0


def test_coefficients_survive_the_change_of_units() -> None:
    c = coefficients_of(REFERENCE_PLANT)
    assert c.plant() == Nonlinear(**vars(REFERENCE_PLANT))
    assert c.at("tau2", DUTY) == pytest.approx(TAU2)


@pytest.mark.parametrize("free", [False, True])
def test_the_limits_in_powers_of_the_duty_are_those_of_the_fit(free: bool) -> None:
    """Row by row the same slack, in whatever basis the model is written; that of τ2's end is the fit's alone."""
    p = Nonlinear((0.2, 1e-3, -1e-5), (1.0, -3e-2, 2e-4), (-0.5, 1e-2, 1e-3, 1e-6), (10.0, 90.0), 0.8)
    c = coefficients_of(p, free)
    A, b = limits_of(c.counts, c.u_range, free)
    basis = basis_of(np.linspace(10.0, 90.0, 9), None if free else p.C)
    of_the_fit, least, _ = constraints(basis, 20.0)
    slack = np.delete(of_the_fit @ basis.unknowns(p) - least, slice(303, 404))
    assert A @ c.values - b == pytest.approx(slack, abs=1e-12) and (slack < 0).any()
    assert A.shape == (303 + 2 * free, 10 + free)
