"""Make data, fit, and the truth returns: noise-free, from other plants, under noise, and whatever the units."""

from typing import Any

import numpy as np
import pandas as pd
import pytest

import eaid
from benchmarks import fit_quality

TAU1, TAU2, TS = (6.74e-3, 2.39e-2, -2.13e-4), (0.93, 0.41, -2.64e-3), (0.032, 9.2e-3, 2.1e-4, 1.32e-6)
"""The reference plant of docs/specification.md."""
MODEL = {"model": ("nonlinear",), "ci": "none"}


def curve(t: Any, Ts: float, tau1: float, tau2: float, share: float = 0.85) -> Any:
    s = np.maximum(t, 0.0)
    return Ts * (1 - share * np.exp(-s / tau1) - (1 - share) * np.exp(-s / tau2))


@pytest.mark.parametrize(
    ("duration_s", "rate_hz", "share"),
    [(20.0, 500.0, 0.85), *(pytest.param(20.0, *more, marks=pytest.mark.slow) for more in ((25.0, 0.85), (50.0, 0.7)))],
)
def test_ten_coefficients_of_the_reference_plant(duration_s: float, rate_hz: float, share: float) -> None:
    t = np.arange(round((duration_s + 2) * rate_hz)) / rate_hz
    rows = {float(u): [np.polynomial.Polynomial(c)(u) for c in (TS, TAU1, TAU2)] for u in range(10, 101, 10)}
    logs = {
        f"u{u}": pd.DataFrame({"time_s": t, "duty_pct": u * (t >= 2), "torque_nm": curve(t - 2, *row, share=share)})
        for u, row in rows.items()
    }
    for estimator in ("auto", "joint"):
        fit = eaid.fit(logs, share="free" if share != 0.85 else 0.85, estimator=estimator, **MODEL)
        assert fit.converged and pytest.approx(share, rel=1e-6) == fit.nonlinear.C
        assert [*fit.plant.tau1, *fit.plant.tau2, *fit.plant.Ts] == pytest.approx([*TAU1, *TAU2, *TS], rel=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_the_cost_is_that_of_the_best_of_an_independent_multi_start(seed: int) -> None:
    case = fit_quality.make(seed)
    mine, converged = fit_quality.ours(case)
    assert converged
    assert mine <= (1 + 1e-6) * fit_quality.best_of_others(case, starts=2)


def test_tables_one_and_two_return() -> None:
    """Trends over stress [kPa] and speed [RPM]."""
    stress = {f: f / (np.pi * (0.06**2 - 0.04**2)) / 1e3 for f in range(17, 171, 17)}
    by_force = {
        f: (0.0944 * x - 0.0896, 6.01 * np.exp(-0.431 * x) + 0.11 * np.exp(0.0492 * x),
            40.25 * np.exp(-0.219 * x) + 1.37 * np.exp(0.0476 * x))
        for f, x in stress.items()
    }  # fmt: skip
    by_speed = {
        s: (0.349 * np.exp(-0.230 * s) + 1.042 * np.exp(0.00608 * s),
            0.425 * np.exp(-0.310 * s) + 0.0498 * np.exp(-0.0150 * s), 5.4 * np.exp(-0.0101 * s))
        for s in range(5, 41, 5)
    }  # fmt: skip

    def trends(column: str, rows: dict[int, Any], t: Any) -> Any:
        on, of = t >= 2, {u: curve(t - 2, *row) for u, row in rows.items()}
        logs = {f"u{u}": pd.DataFrame({"time_s": t, column: 1.0 * u * on, "torque_nm": y}) for u, y in of.items()}
        return eaid.fit(logs, ci="none").friction

    forces = trends("force_n", by_force, np.arange(6200) / 100)
    speeds = trends("speed_rpm", by_speed, np.arange(3200) / 100)
    assert (forces.over, speeds.over) == ("stress_kpa", "speed_rpm")
    assert forces.trends["Ts"].coefficients == pytest.approx((0.0944, -0.0896), rel=1e-6)
    assert forces.trends["tau1"].coefficients == pytest.approx((0.11, 0.0492, 6.01, -0.431), rel=1e-5)
    assert forces.trends["tau2"].coefficients == pytest.approx((1.37, 0.0476, 40.25, -0.219), rel=1e-5)
    assert "C_f" in forces.trends and "C_f" not in speeds.trends
    assert speeds.trends["Ts"].coefficients == pytest.approx((1.042, 0.00608, 0.349, -0.230), rel=1e-5)
    assert speeds.trends["tau1"].coefficients == pytest.approx((0.0498, -0.0150, 0.425, -0.310), rel=1e-5)
