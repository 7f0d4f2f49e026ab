"""Fits written by hand, as a user's script writes fit.json, and the gains that `eaid.tune_rc` makes of them."""

from collections.abc import Callable
from typing import Any

import pytest

import eaid

from ..conftest import LINEAR, PLANT, loaded, made_once


@pytest.fixture(scope="session")
def fit_of() -> Callable[..., "eaid.Fit"]:
    """The paper's linear model with some numbers changed, a nonlinear one (True: the reference plant), other parts."""

    def fit_of(linear: dict[str, Any] | None = None, nonlinear: Any = None, **parts: Any) -> "eaid.Fit":
        plant = PLANT if nonlinear is True else nonlinear
        return loaded({"linear": {**LINEAR, **(linear or {})}, "nonlinear": plant, **parts})

    return fit_of


@pytest.fixture(scope="session")
def tuned(fit_of: Callable[..., "eaid.Fit"]) -> Callable[..., "eaid.Gains"]:
    """Gains of such a fit under options of `tune_rc`; made once of the same numbers."""
    names = ("linear", "nonlinear", "data", "steps", "uncertainty", "findings")

    @made_once
    def tuned(**given: Any) -> "eaid.Gains":
        parts = {name: given.pop(name) for name in names if name in given}
        return eaid.tune_rc(fit_of(**parts), **given)

    return tuned


@pytest.fixture(scope="session")
def told() -> Callable[..., dict[str, dict[str, Any]]]:
    """Findings of gains by code, with their values."""
    return lambda gains: {one.code: dict(one.values) for one in gains.findings}


@pytest.fixture(scope="session")
def rises() -> Callable[[float], list[dict[str, Any]]]:
    """Three single steps upwards, as fit.json has them, with dead times around one."""
    step = {"edge": "up", "start": 0.0, "change": 1.0, "gain": 1.0, "shape": "one", "tau1": 0.74, "tau2": None,
            "C": 1.0, "rmse": 0.0, "fit_pct": 99.0, "R2": 1.0, "samples": 9}  # fmt: skip
    return lambda dead_s: [
        {**step, "run": f"r{k}", "from": 0.0, "level": k, "dead_time_s": dead_s + off}
        for k, off in enumerate((-0.01, 0.0, 0.01), 1)
    ]
