import numpy as np
import pytest

import eaid
from eaid.estimate.coefficients import coefficients_of
from eaid.estimate.draw import draw
from eaid.plant.dynamics import REFERENCE_PLANT
from eaid.results import codec

P = REFERENCE_PLANT


def fit_json(sd: float, of_share: float | None = None) -> eaid.Fit:
    """Coefficients that are known to a part of themselves, and a share that is held or known to ±."""
    variances = np.append((sd * coefficients_of(P).values) ** 2, [] if of_share is None else [of_share**2])
    order = {} if of_share is None else {"order": ["…"] * 10 + ["C"]}
    part = {"C": P.C, "tau1": list(P.tau1), "tau2": list(P.tau2), "Ts": list(P.Ts), "u_range": list(P.u_range)}
    part["covariance"] = {"matrix": np.diag(variances).tolist(), **order}
    return codec.from_plain({"schema": "eaid/fit/2", "nonlinear": part}, eaid.Fit, "a test")


def test_same_seed_same_plants() -> None:
    assert draw(fit_json(0.02), 5, 1).plants == draw(fit_json(0.02), 5, 1).plants
    assert draw(fit_json(0.02), 5, 1).plants != draw(fit_json(0.02), 5, 2).plants
    assert draw(fit_json(0.02), 5, 1).plants[:3] == draw(fit_json(0.02), 3, 1).plants


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


def test_a_free_share_is_drawn_too_and_stays_a_share() -> None:
    shares = [p.C for p in draw(fit_json(0.01, of_share=0.1), 200, 0).plants]
    assert np.std(shares) == pytest.approx(0.08, abs=0.03) and min(shares) >= 0 and max(shares) <= 1


def test_the_share_of_rejected_draws_is_told() -> None:
    drawn = draw(fit_json(0.5), 40, 3)
    assert drawn.rejected_share > 0.05
    (told,) = drawn.findings
    assert told.code == "draws-rejected" and told.values["pct"] == pytest.approx(100 * drawn.rejected_share)
