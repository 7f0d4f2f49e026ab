import numpy as np
import pytest

import eaid
from eaid.estimate.coefficients import coefficients_of
from eaid.estimate.draw import draw, drawable
from eaid.plant.dynamics import REFERENCE_PLANT
from eaid.results import codec

P = REFERENCE_PLANT


def fit_of(part: dict) -> eaid.Fit:
    return codec.from_plain({"schema": "eaid/fit/2", "nonlinear": part}, eaid.Fit, "a test")


def part_json(sd: float | None) -> dict:
    part = {"C": P.C, "tau1": list(P.tau1), "tau2": list(P.tau2), "Ts": list(P.Ts), "u_range": list(P.u_range)}
    if sd is not None:
        values = coefficients_of(P).values
        part["covariance"] = {"matrix": np.diag((sd * values) ** 2).tolist()}
    return part


def fit_json(sd: float | None) -> eaid.Fit:
    return fit_of(part_json(sd))


def test_same_seed_same_plants() -> None:
    assert draw(fit_json(0.02), 5, 1).plants == draw(fit_json(0.02), 5, 1).plants
    assert draw(fit_json(0.02), 5, 1).plants != draw(fit_json(0.02), 5, 2).plants
    assert draw(fit_json(0.02), 5, 1).plants[:3] == draw(fit_json(0.02), 3, 1).plants


@pytest.mark.slow
def test_spread_is_the_covariance() -> None:
    drawn = np.array([p.tau2 for p in draw(fit_json(0.02), 2000, 0).plants])
    assert drawn.std(axis=0) == pytest.approx(0.02 * np.abs(P.tau2), rel=0.06)
    assert drawn.mean(axis=0) == pytest.approx(P.tau2, rel=0.01)


@pytest.mark.parametrize("sd", [0.05, 0.5, 5.0])
def test_every_plant_keeps_the_constraints(sd: float) -> None:
    duty = np.linspace(*P.u_range, 101)
    plants = draw(fit_json(sd), 50, 3).plants
    assert len({p.tau2 for p in plants}) == 50 or sd > 1  # what is far out ends at the same farthest curves
    for p in plants:
        tau1, tau2 = p.time_constants(duty)
        assert tau1.min() >= 1e-3 - 1e-9
        assert (tau2 - tau1).min() >= -1e-9
        assert p.steady(duty).min() >= -1e-9


def test_a_minimal_fit_gives_the_plant_itself() -> None:
    minimal = fit_of({"tau1": list(P.tau1), "tau2": list(P.tau2), "Ts": list(P.Ts), "u_range": [10, 100]})
    plants = draw(minimal, 3, 0).plants
    assert len(plants) == 3 and len(set(plants)) == 1
    assert not drawable(minimal) and drawable(fit_json(0.1))


def test_a_free_share_is_drawn_too_and_stays_a_share() -> None:
    free = part_json(0.01)
    matrix = np.zeros((11, 11))
    matrix[:10, :10] = free["covariance"]["matrix"]
    matrix[10, 10] = 0.1**2
    free["covariance"] = {"matrix": matrix.tolist(), "order": ["…"] * 10 + ["C"]}
    shares = [p.C for p in draw(fit_of(free), 200, 0).plants]
    assert np.std(shares) == pytest.approx(0.08, abs=0.03) and min(shares) >= 0 and max(shares) <= 1


def test_the_share_of_rejected_draws_is_told() -> None:
    drawn = draw(fit_json(0.5), 40, 3)
    assert drawn.rejected_share > 0.05
    (told,) = drawn.findings
    assert told.code == "draws-rejected" and told.values["pct"] == pytest.approx(100 * drawn.rejected_share)
