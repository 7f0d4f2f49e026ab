import numpy as np
import pytest

from eaid.errors import DataError
from eaid.models import nonlinear
from eaid.models.parameters import REFERENCE_PLANT
from eaid.uncertainty.draw import covariance_word, draw_plants
from eaid.uncertainty.joint import coefficients_of

P = REFERENCE_PLANT


def fit_json(sd: float | None) -> dict:
    part = {"C": P.C, "tau1": list(P.tau1), "tau2": list(P.tau2), "Ts": list(P.Ts), "u_range": list(P.u_range)}
    if sd is not None:
        values = coefficients_of(P).values
        part["covariance"] = {"matrix": np.diag((sd * values) ** 2).tolist()}
    return {"nonlinear": part}


def test_same_seed_same_plants() -> None:
    assert draw_plants(fit_json(0.02), 5, 1) == draw_plants(fit_json(0.02), 5, 1)
    assert draw_plants(fit_json(0.02), 5, 1) != draw_plants(fit_json(0.02), 5, 2)
    assert draw_plants(fit_json(0.02), 5, 1)[:3] == draw_plants(fit_json(0.02), 3, 1)


def test_spread_is_the_covariance() -> None:
    drawn = np.array([p.tau2 for p in draw_plants(fit_json(0.02), 2000, 0)])
    assert drawn.std(axis=0) == pytest.approx(0.02 * np.abs(P.tau2), rel=0.06)
    assert drawn.mean(axis=0) == pytest.approx(P.tau2, rel=0.01)


@pytest.mark.parametrize("sd", [0.05, 0.5, 5.0])
def test_every_plant_keeps_the_constraints(sd: float) -> None:
    duty = np.linspace(*P.u_range, 101)
    plants = draw_plants(fit_json(sd), 50, 3)
    assert len({p.tau2 for p in plants}) == 50
    for p in plants:
        tau1, tau2 = nonlinear.time_constants(p, duty)
        assert tau1.min() >= 1e-3 - 1e-9
        assert (tau2 - tau1).min() >= -1e-9
        assert nonlinear.steady_torque(p, duty).min() >= -1e-9


def test_a_minimal_fit_gives_the_plant_itself_and_a_word() -> None:
    minimal = {"nonlinear": {"tau1": list(P.tau1), "tau2": list(P.tau2), "Ts": list(P.Ts), "u_range": [10, 100]}}
    plants = draw_plants(minimal, 3, 0)
    assert len(plants) == 3 and len(set(plants)) == 1
    assert "no covariance" in (covariance_word(minimal) or "")
    assert covariance_word(fit_json(0.1)) is None


def test_a_free_share_is_drawn_too_and_stays_a_share() -> None:
    free = fit_json(0.01)
    matrix = np.zeros((11, 11))
    matrix[:10, :10] = free["nonlinear"]["covariance"]["matrix"]
    matrix[10, 10] = 0.1**2
    free["nonlinear"]["covariance"] = {"matrix": matrix.tolist(), "order": ["…"] * 10 + ["C"]}
    shares = [p.C for p in draw_plants(free, 200, 0)]
    assert np.std(shares) == pytest.approx(0.08, abs=0.03) and min(shares) >= 0 and max(shares) <= 1


def test_a_broken_covariance_is_refused() -> None:
    broken = fit_json(0.1)
    broken["nonlinear"]["covariance"]["matrix"] = [[1.0, 2.0]]
    with pytest.raises(DataError, match="expected 10 x 10"):
        draw_plants(broken, 1, 0)
