"""Fits written by hand, as a user's script writes fit.json, and the gains that `eaid.tune_rc` makes of them."""

import json
from collections.abc import Callable
from itertools import count
from typing import Any

import pytest

import eaid

PAPER = {"a0": 1.36, "b0": 0.08, "c0": -2.42, "bounds": {"B_m": 12.4, "B_M": 42.6}}
REFERENCE = {
    "C": 0.85, "tau1": [6.74e-3, 2.39e-2, -2.13e-4], "tau2": [0.93, 0.41, -2.64e-3],
    "Ts": [0.032, 9.2e-3, 2.1e-4, 1.32e-6], "u_range": [10.0, 100.0],
}  # fmt: skip


@pytest.fixture(scope="session")
def fit_of(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., "eaid.Fit"]:
    """The paper's linear model with some numbers changed, a nonlinear one (True: the reference plant), other parts."""
    folder, number = tmp_path_factory.mktemp("fits"), count()

    def fit_of(linear: dict[str, Any] | None = None, nonlinear: Any = None, **parts: Any) -> "eaid.Fit":
        plain = {"linear": {**PAPER, **(linear or {})}, **parts}
        if nonlinear is not None:
            plain["nonlinear"] = REFERENCE if nonlinear is True else nonlinear
        file = folder / f"{next(number)}.json"
        file.write_text(json.dumps(plain), encoding="utf-8")
        return eaid.load(file)

    return fit_of


@pytest.fixture(scope="session")
def tuned(fit_of: Callable[..., "eaid.Fit"]) -> Callable[..., "eaid.Gains"]:
    """Gains of such a fit under options of `tune_rc`."""
    names = ("linear", "nonlinear", "data", "steps", "uncertainty", "findings")

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
