from dataclasses import replace

import numpy as np
import pytest

from eaid.estimate.scatter import ASSUMED, unit_variances
from eaid.estimate.spread import t_quantile
from eaid.planning.design import rig_of
from eaid.plant.dynamics import REFERENCE_PLANT, Step
from eaid.results.fit import Fit, FittedData, Friction, FrictionLevel, Noise, Nonlinear, Uncertainty


def curve_at(duty: float) -> Step:
    return REFERENCE_PLANT.at(duty)


def test_widths_of_pure_scatter_by_hand() -> None:
    """No noise within a run: t σ/√R at a level, exp(·) − 1 in percent; three levels make a parabola, each its place."""
    levels, spread = [20.0, 50.0, 80.0], np.array([0.03, 0.05, 0.1])
    rows = tuple(
        FrictionLevel(u, **{name: getattr(curve_at(u), name) for name in ("Ts", "tau1", "tau2")}) for u in levels
    )
    model = Nonlinear(**{name: getattr(REFERENCE_PLANT, name) for name in ("tau1", "tau2", "Ts")}, u_range=(20.0, 80.0))
    for part, degrees in ({"friction": Friction(levels=rows)}, 9), ({"nonlinear": model}, 3):
        kind = "clutch" if "nonlinear" in part else "friction-speed"
        noise = Noise(0.0, 0.0, dict(zip(("Ts", "tau1", "tau2"), spread.tolist(), strict=True)))
        rig = replace(rig_of(Fit(data=FittedData(kind=kind), **part)), noise=noise, known=False)
        found = rig.half_widths(levels, np.full(3, 30.0), np.array([4.0]))
        np.testing.assert_allclose(found[:, 0], 100 * np.expm1(t_quantile(degrees) * spread / 2), rtol=1e-6)


def test_information_is_the_sum_over_samples() -> None:
    from eaid.estimate.scatter import log_jacobian

    t = (np.arange(40_000) + 0.5) * 1e-3
    J = log_jacobian(curve_at(50.0), t)
    inverse = np.linalg.inv(J.T @ J * 1e-3)
    found = unit_variances(curve_at(50.0), 40.0)
    assert found[:, 0] == pytest.approx(np.diag(inverse), rel=1e-2)
    scores = inverse @ (J.T * J[:, 0]) * np.sqrt(1e-3)  # noise of density 1 times the torque itself
    assert found[:, 1] == pytest.approx((scores**2).sum(axis=1), rel=1e-2)


def test_scatter_that_is_known_from_few_runs_is_taken_larger() -> None:
    """√(ν/χ²) at 20 %: 1.17 for 20 degrees of freedom, by hand from χ²₀.₂(20) = 14.578."""
    levels = (FrictionLevel(50.0, 1.0, 0.2, 2.0),)

    def taken(degrees: float) -> Noise:
        known = Uncertainty(degrees_of_freedom=degrees, noise=ASSUMED)
        return rig_of(
            Fit(data=FittedData("friction-speed"), friction=Friction(levels=levels), uncertainty=known)
        ).design_noise

    assert taken(20.0).scatter["Ts"] == pytest.approx(0.03 * np.sqrt(20 / 14.578), rel=1e-4)
    assert taken(0.0) == ASSUMED
