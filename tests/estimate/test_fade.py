"""A response that fades in proportion while it is held: found, taken off, and told from another C."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import eaid
from tests.estimate.test_creep import within

LEVELS = (2.0, 4.0, 6.0, 8.0, 10.0)
IDLE_S, HOLD_S = 2.0, 30.0


def logs(fade: float, C: float = 0.85, names: tuple[str, str] = ("input_V", "output_N")) -> list[pd.DataFrame]:
    """Those of `test_creep`, held twice as long, which fade by so much of their response a second."""
    random, found = np.random.default_rng(1), []
    t = np.arange(0.0, IDLE_S + HOLD_S, 0.02)
    s = np.maximum(t - IDLE_S, 0.0)
    for u in LEVELS:
        for _ in range(3):
            tau = np.array([0.3, 5.0]) * (1 + 0.02 * random.normal())
            size = (0.2 * u + 0.03 * u * u) * (1 + 0.04 * random.normal())
            y = size * -(C * np.expm1(-s / tau[0]) + (1 - C) * np.expm1(-s / tau[1])) * (1 - fade * s)
            y += 0.02 * random.normal(size=len(t))
            found.append(pd.DataFrame({"time_s": t, names[0]: np.where(t >= IDLE_S, u, 0.0), names[1]: y}))
    return found


def test_a_fade_is_taken_off(tmp_path: Path) -> None:
    """One of 3 % in 30 s made τ2 a third too short, ± 1 %, and C another, "usable"."""
    for k, log in enumerate(logs(0.001), 10):
        log.to_csv(tmp_path / f"{k}.csv", index=False)
    fit = eaid.fit(tmp_path)
    told = {one.code: one.values for one in fit.findings}
    assert told["fade-taken-off"]["low"] < 3.0 < told["fade-taken-off"]["high"] < 3.5
    assert fit.verdict.usable and fit.plant.C == 0.85
    assert within(fit) >= 13
    assert fit.at(6.0).loc["tau2", "value"] == pytest.approx(5.0, rel=0.05)
    assert fit.data.creep is not None and fit.data.creep.in_proportion
    assert fit.residuals.std() == pytest.approx(fit.rmse, rel=0.02)
    again = eaid.simulate(fit, log=tmp_path)
    own = [one.metrics.fit_pct for one in again.records.values()]
    assert own == [one.fit_pct for one in fit.data.replayed]
    assert own == pytest.approx([one.fit_pct for one in eaid.fit(logs(0.0)).data.replayed], abs=0.5)


def test_another_share_is_no_fade() -> None:
    fit = eaid.fit(logs(0.0, C=0.9))
    assert not {"fade-taken-off", "fade-possible"} & {one.code for one in fit.findings}
    assert pytest.approx(0.9, abs=0.01) == fit.plant.C


def test_friction_fades_too() -> None:
    """A friction rig's levels, each by itself, have no polynomials."""
    fit = eaid.fit(logs(0.001, names=("normal_force_N", "torque_Nm")))
    assert "fade-taken-off" in {one.code for one in fit.findings}
    assert fit.at(6.0).loc["tau2", "value"] == pytest.approx(5.0, rel=0.05)
