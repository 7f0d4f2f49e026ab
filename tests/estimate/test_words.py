"""What the data cannot tell, case by case: each set gets its sentence, in fit.json, on the terminal, on the page."""

from typing import Any

import numpy as np
import pytest

import eaid
from eaid.apparatus import Apparatus
from eaid.models import friction
from eaid.models.parameters import Friction
from eaid.steps.stepset import Level, StepSet


def codes(found: eaid.Fit) -> set[str]:
    return {one.code for one in found.findings}


def judged(stepset: StepSet, **options: Any) -> eaid.Fit:
    return eaid.fit(stepset, **options)


def noisy(kind: str, unit: str, curves: dict[float, Friction], end_s: float, noise: float = 0.002) -> StepSet:
    """Three repeats of each level: the curve, a gain factor 1 + 0.02 N, and white noise."""
    random = np.random.default_rng(3)
    t = np.linspace(0, end_s, 400)
    levels = []
    for level, curve in curves.items():
        gains = 1 + 0.02 * random.standard_normal((3, 1))
        runs = gains * friction.step_response(curve, t) + noise * random.standard_normal((3, len(t)))
        levels.append(Level(level, t, runs, ("a", "b", "c")))
    return StepSet(kind, unit, "N·m", Apparatus(), tuple(levels))


def test_a_window_too_short_for_tau2(sets: Any) -> None:
    """τ2 is 5 to 17 s, the record 3 s: a range and how well the curve itself is known; nothing to be believed of τ2."""
    curves = {float(u): sets.plant(float(u), sets.VARIANTS["base"]) for u in range(10, 101, 10)}
    sure = judged(noisy("clutch", "%", curves, 3.0))
    assert sure.nonlinear is not None
    assert sure.nonlinear.identifiable is False
    (reason,) = [one for one in sure.not_identifiable_because("nonlinear") if one.values["parameter"] == "tau2"]
    assert reason.values["cause"] == "short-record" and reason.values["record_s"] == pytest.approx(3.0)
    left = [one for one in sure.findings if one.code == "tau2-open"]
    assert left and all(one.values["record_s"] == pytest.approx(3.0) for one in left)
    assert sure.friction is not None and not any(row.ci95.tau2 for row in sure.friction.levels if row.ci95)


def test_at_a_constraint_nothing_is_estimable() -> None:
    """One exponential in truth: τ1 and τ2 meet, or τ2 has no end; no interval is given for what a constraint holds."""
    curves = {float(u): Friction(u / 25, 0.4, 0.4 + 1e-9) for u in (20, 40, 60, 80, 100)}
    sure = judged(noisy("clutch", "%", curves, 6.0))
    assert sure.friction is not None and sure.nonlinear is not None
    met = [row for row in sure.friction.levels if row.ci95.tau1 is None]
    assert {"taus-meet", "parameter-constrained"} & codes(sure) and met and all(row.ci95.tau2 is None for row in met)
