"""A short run of benchmarks/coverage.py: wide binomial bands, but the textbook's intervals fall far outside them."""

from typing import Any

import numpy as np
import pytest

from benchmarks import coverage
from eaid.estimate.spread import t_quantile

SETS = 24
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def base() -> Any:
    return coverage.measure(coverage.VARIANTS["base"], SETS, first=10_000)


def band(values: np.ndarray, independent: float) -> tuple[float, float]:
    """Three standard errors about 95 % for so many independent intervals."""
    error = 300 * np.sqrt(0.95 * 0.05 / independent)
    return 95 - error, min(100.0, 95 + error)


@pytest.mark.parametrize("name", ["Ts", "tau1", "tau2"])
def test_single_levels_hold(base: Any, name: str) -> None:
    low, high = band(base.ours[f"level {name}"], SETS * 4)
    assert low <= base.ours[f"level {name}"].mean() <= high


@pytest.mark.parametrize("name", ["Ts", "tau1", "tau2"])
def test_curves_hold(base: Any, name: str) -> None:
    low, _ = band(base.ours[f"curves {name}"], SETS * 2)
    assert base.ours[f"curves {name}"].mean() >= low


@pytest.mark.parametrize("name", ["a0", "b0", "c0", "B_m", "B_M"])
def test_linear_model_holds(base: Any, name: str) -> None:
    assert base.ours[f"linear {name}"][0] >= band(np.array([]), SETS)[0]


def test_the_textbook_does_not(base: Any) -> None:
    assert base.textbook["level Ts"].mean() < 40
    assert base.textbook["level tau1"].mean() < 50
    assert base.textbook["joint tau2"].mean() < 40
    assert base.textbook["linear B"].mean() < 70


def test_half_widths_are_those_of_the_scatter(base: Any) -> None:
    """t σ/√R for a level by itself, times √(p/L) for a curve of p terms through L levels: σ is 3 % in T_s, 5 % in τ1.

    A level and half of each neighbour have 2 · 2²/(1 + ½) = 5.3 degrees of freedom.
    """
    t, root = t_quantile(16 / 3), np.sqrt(3)
    for name, width in {"Ts": t * 3 / root * np.sqrt(0.4), "tau1": t * 5 / root * np.sqrt(0.3)}.items():
        assert base.widths[f"curves {name}"] == pytest.approx(width, rel=0.25), name
        assert base.widths[f"level {name}"] >= base.widths[f"curves {name}"]  # a level may lie off the curve


def test_sweeps_are_noticed_and_covered() -> None:
    """One gain a sweep: Σ(R − 1) would count 20 independent runs where there are two."""
    swept = coverage.measure(coverage.VARIANTS["sweeps"], 12, first=30_000)
    assert swept.ours["level Ts"].mean() >= 85 and swept.ours["curves Ts"].mean() >= 85
    assert swept.widths["curves Ts"] > 2 * 2.3


def test_one_run_a_level_gives_the_curve() -> None:
    single = coverage.measure(coverage.VARIANTS["single"], 12, first=20_000)
    for name in ("Ts", "tau1", "tau2"):
        assert np.nanmean(single.ours[f"curves {name}"]) >= 85  # NaN: a level whose τ2 hardly any set tells
    assert single.textbook["level Ts"].mean() < 50
