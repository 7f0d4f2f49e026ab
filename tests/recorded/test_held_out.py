"""A fit of recorded logs is judged on what a fit without it has not seen."""

import numpy as np
import pandas as pd
import pytest

import eaid
from eaid.estimate.recorded_log import RecordedLog
from eaid.recorded.held_out import _parts_left_out

DT_S = 0.02


def lag(u: np.ndarray, tau_s: float, gain: float = 0.05) -> np.ndarray:
    y, keep = np.zeros(len(u)), np.exp(-DT_S / tau_s)
    for k in range(1, len(u)):
        y[k] = keep * y[k - 1] + (1 - keep) * gain * u[k - 1]
    return y


def log(seed: int, seconds: float = 60.0, drift: float = 0.0) -> pd.DataFrame:
    """A lag of 0.5 s under random steps; `drift` is a random walk of the output that the input does not make."""
    random, n = np.random.default_rng(seed), int(seconds / DT_S)
    u = np.append(np.zeros(50), np.repeat(random.uniform(10, 100, n // 50), 50))[:n]
    walk = np.cumsum(random.standard_normal(n)) * drift
    y = lag(u, 0.5) + walk + 0.02 * random.standard_normal(n)
    return pd.DataFrame({"time_s": DT_S * np.arange(n), "duty_pct": u, "torque_nm": y})


def fit(*logs: pd.DataFrame) -> eaid.Fit:
    named = {f"log{k}": one for k, one in enumerate(logs)}
    return eaid.fit(eaid.read(named, logs_as="recorded"), model=("nonlinear",), ci="none", shape="one")


@pytest.mark.parametrize(
    ("logs", "of"), [((1,), "last third"), pytest.param((1, 2, 3), "logs", marks=pytest.mark.slow)]
)
def test_a_plant_that_is_there_holds_where_it_has_not_seen(logs: tuple[int, ...], of: str) -> None:
    found = fit(*map(log, logs))
    unseen = found.recorded.hold_out
    assert unseen.of == of and abs(unseen.held_pct - unseen.fit_pct) < 1 and unseen.fit_pct > 95
    assert found.verdict.usable and f"unseen {unseen.held_pct:.1f} % explained of" in found.summary()


@pytest.mark.slow
@pytest.mark.parametrize("seed", [5, 6, 7, 22])
def test_a_walk_that_no_input_makes_is_not_usable(seed: int) -> None:
    random, n = np.random.default_rng(seed), 3000
    u = np.append(np.zeros(50), np.repeat(random.uniform(10, 100, n // 50), 50))[:n]
    walk = pd.DataFrame(
        {"time_s": DT_S * np.arange(n), "duty_pct": u, "torque_nm": np.cumsum(random.standard_normal(n))}
    )
    found = fit(walk)
    assert found.recorded.hold_out.fit_pct > 60  # a percentage of what was fitted proves nothing
    assert "drift-explains-as-much" in {one.code for one in found.verdict.reasons}
    if seed == 5:
        drifts = walk.assign(torque_nm=lag(u, 0.5) + 0.02 * walk["torque_nm"])
        assert "drift-explains-as-much" not in {one.code for one in fit(drifts).findings}


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_rest_that_does_not_tell_the_model_is_no_witness(seed: int) -> None:
    """Two thirds of a slow multisine: their fit explained the last to −400,000 %, and the right one was stopped."""
    random, dt_s = np.random.default_rng(seed), 0.05
    t, x1, x2, y = np.arange(600) * dt_s, 0.0, 0.0, np.empty(600)
    u = 5 + sum(
        np.sin(2 * np.pi * (f * t + p)) for f, p in zip((0.03, 0.07, 0.15, 0.31), random.random(4), strict=True)
    )
    for k in range(600):
        y[k] = x1 + x2
        x1 += (1 - np.exp(-dt_s / 0.6)) * (0.34 * u[k] - x1)
        x2 += (1 - np.exp(-dt_s / 6.0)) * (0.06 * u[k] - x2)
    fit = eaid.fit(t, u, y + 0.004 * random.standard_normal(600), shape="one")
    assert fit.verdict.usable and fit.recorded.hold_out is None


def test_a_log_that_alone_tells_the_curve_is_not_left_out() -> None:
    """Three logs of one input each, and one of all, whose T_s(u) needs six: by what was left the curve was −251 %."""
    inputs = [np.repeat([0.0, u], 50) for u in (20.0, 60.0, 100.0)] + [np.repeat(np.arange(0.0, 101.0, 10.0), 10)]
    logs = [RecordedLog(f"log{k}", DT_S * np.arange(len(u)), u, u) for k, u in enumerate(inputs)]
    folds = [[one for one, out in zip(logs, rows, strict=True) if out.any()] for _, rows in _parts_left_out(logs, 6)]
    assert folds == [[log] for log in logs[:1] + logs[1:2] + logs[2:3]]
    assert len([*_parts_left_out(logs, 3)]) == 4
