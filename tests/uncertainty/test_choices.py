"""What is chosen and recommended, by hand-made scores on both sides of each threshold."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from eaid.results.fit import Agreement, Disagreement, LackOfFit, OrderScore, ShapeScore
from eaid.uncertainty.adequacy import _recommended, raised_orders
from eaid.uncertainty.level_statistics import constrained_parameters
from eaid.uncertainty.nonlinear_intervals import chosen
from eaid.uncertainty.share import Share


def scores(**aicc: float) -> list[OrderScore]:
    """Orders of τ1 by their AICc, as o1=…, o2=…"""
    return [OrderScore("tau1", int(name[1]), 0.0, value) for name, value in aicc.items()]


@pytest.mark.parametrize(
    ("aicc", "raised"),
    [
        ({"o2": 20.0, "o3": 15.9}, {"tau1": 3}),
        ({"o2": 20.0, "o3": 16.1}, {}),
        ({"o1": 5.0, "o2": 20.0, "o3": 12.0}, {}),
        ({"o2": 20.0, "o3": 15.0, "o4": 10.0}, {"tau1": 4}),
        ({"o1": 1.0, "o3": 0.0}, {}),
    ],
)
def test_a_higher_order_needs_four_of_aicc(aicc: dict[str, float], raised: dict[str, int]) -> None:
    assert raised_orders(scores(**aicc)) == raised


NAMES = ("one exponential", "two exponentials, C = 0.85", "two exponentials, C free", "a stretched exponential")


def shapes(bics: tuple[float, ...], rmses: tuple[float, ...]) -> list[ShapeScore]:
    return [ShapeScore(*row) for row in zip(NAMES, (2, 3, 4, 3), rmses, bics, bics, strict=False)]


def row(beyond: bool, level: float = 10.0) -> LackOfFit:
    return LackOfFit(level, 2.0, 1.5, beyond, 0.1 * level)


SHARE = SimpleNamespace(matters=True, differ=False, held=0.85, estimate=0.9)
DIFFERS = SimpleNamespace(matters=True, differ=True, held=0.85, estimate=0.9)


@pytest.mark.parametrize(
    ("bics", "rmses", "missed", "share", "codes"),
    [
        ((50, 0, 9), (2, 1, 1), {}, None, ["shape-fits"]),
        ((50, 0, -5.9), (2, 1, 0.5), {}, None, ["shape-fits"]),  # not strong
        ((50, 0, -6.0), (2, 1, 0.89), {}, None, ["shape-of-another-kind"]),
        ((50, 0, -60), (2, 1, 0.91), {}, None, ["shape-fits"]),  # closer by less than a tenth
        ((-60, 0, 9), (1, 1, 1), {}, None, ["shape-of-another-kind"]),
        ((50, 0, -60), (2, 1, 0.5), {}, SHARE, ["shape-needs-the-share"]),
        ((50, 0, -60), (2, 1, 0.5), {}, DIFFERS, ["shape-of-another-kind"]),
        ((-60, 0, 9), (1, 1, 1), {}, SHARE, ["shape-of-another-kind"]),
        ((50, 0, 9, -60), (2, 1, 1, 0.5), {NAMES[3]: 2}, SHARE, ["shape-of-another-kind"]),
        ((50, 0, 9, -5), (2, 1, 1, 0.5), {NAMES[3]: 2}, None, ["shape-fits"]),
        ((50, 0, 9, -60), (2, 1, 1, 0.5), {NAMES[3]: 3}, None, ["no-shape-fits"]),
    ],
)
def test_shapes_are_recommended_by_evidence(bics: Any, rmses: Any, missed: Any, share: Any, codes: list[str]) -> None:
    found = _recommended(shapes(bics, rmses), missed, (), [row(False)] * 8, share)
    assert [one.code for one in found] == codes


def test_the_worst_level_that_repeats_miss_alike_is_told() -> None:
    rows = [row(True, 20.0), row(True, 50.0), row(False, 90.0)]
    found = _recommended(shapes((50, 0, 9), (2, 1, 1)), {}, (), rows, None)[-1]
    assert found.code == "repeats-miss-alike" and found.levels == (20.0, 50.0)
    assert found.values["worst"] == 50.0 and found.values["of"] == 3 and found.values["systematic"] == 5.0


APART = Agreement(("joint", "two-stage"), "two-stage", "apart", (Disagreement("tau1"),))


@pytest.mark.parametrize(
    ("estimator", "says", "there", "taken"),
    [
        ("auto", APART, True, ("two-stage", "apart")),
        ("auto", Agreement(("joint", "two-stage"), "either", "agree"), True, ("joint", "agree")),
        ("auto", Agreement(("joint", "two-stage"), "neither", "weak"), True, ("joint", "weak")),
        ("joint", APART, True, ("joint", "asked")),
        ("auto", APART, False, ("joint", "alone")),
    ],
)
def test_the_estimate_that_is_taken(estimator: str, says: Agreement, there: bool, taken: tuple[str, str]) -> None:
    assert chosen(estimator, says, object() if there else None) == taken  # type: ignore[arg-type]


def level_fit(Ts: float, tau1: float, tau2: float) -> Any:
    return SimpleNamespace(Ts=Ts, tau1=tau1, tau2=tau2)


@pytest.mark.parametrize(
    ("values", "held"),
    [
        ((1.0, 0.2, 5.0), ()),
        ((1.0, 0.001, 5.0), ("tau1",)),
        ((1.0, 0.2, 0.2), ("tau1", "tau2")),
        ((1.0, 0.2, 0.2001), ()),
        ((-1.0, 0.2, 5.0), ("Ts", "tau1", "tau2")),
        ((1.0, 0.2, 1e9), ("tau2",)),
    ],
)
def test_what_a_constraint_holds(values: tuple[float, ...], held: tuple[str, ...]) -> None:
    assert constrained_parameters(level_fit(*values), 20.0, False) == held


def share(estimate: float | None, sd: float, half_width: float = 0.1, held: float = 0.85) -> Share:
    """A C asked of the runs with many degrees of freedom, which moves log τ2 by 10 a unit."""
    slope, widths = np.array([[1.0, 2.0, 10.0]]), np.full((1, 3), half_width)
    return Share(held, estimate, sd, 1e9, (10.0,), False, np.zeros((1, 3)), slope, widths)
