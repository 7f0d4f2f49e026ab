"""A sensor whose zero jumps within a log."""

from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

import eaid
from eaid.plant.dynamics import Plant
from eaid.plant.respond import respond
from tests.conftest import codes

CLUTCH = Plant((0.2, 0.004), (3.0, 0.03), (0.0, 0.02, 1.9e-4), (20.0, 100.0), C=0.85)
T = np.arange(0.0, 120.0, 0.02)


def log_of(seed: int, jump: float = 0.0, at_s: float = 60.0, noise: float = 0.02) -> pd.DataFrame:
    random, u = np.random.default_rng(seed), np.zeros(len(T))
    held = np.repeat(random.choice([0.0, 20.0, 40.0, 60.0, 80.0, 100.0], 60), random.integers(50, 300, 60))
    u[150:-250] = held[: len(T) - 400]
    y = respond(CLUTCH, T, u, T) + jump * (at_s <= T) + noise * random.standard_normal(len(T))
    return pd.DataFrame({"time_s": T, "duty_pct": u, "torque_nm": y})


SOME = [(0, 0.15, 60.0), pytest.param(2, 0.3, 100.0, marks=pytest.mark.slow)]


@pytest.mark.parametrize(("seed", "jump", "at_s"), SOME)
def test_it_is_found_and_the_fit_is_without_it(seed: int, jump: float, at_s: float) -> None:
    """0.15 of 3.9 N·m: T_s 3 % off, or a slow part without end, "usable yes", in silence."""
    log = log_of(seed, jump, at_s)
    fit = eaid.fit(log)
    told = codes(fit)["zero-jumps"].values
    assert (told["at_s"], told["size"]) == pytest.approx((at_s, jump), rel=0.05)
    for level in (20.0, 60.0, 100.0):
        at = fit.at(level)
        for name, true in zip(
            ("Ts", "tau1", "tau2"), (CLUTCH.steady(level), *CLUTCH.time_constants(level)), strict=True
        ):
            low, high = at.loc[name, ["low", "high"]]
            assert 0.97 * low < float(true) < 1.03 * high, (level, name)
    (record,) = eaid.simulate(fit, log=log).records.values()
    assert record.metrics.fit_pct == pytest.approx(fit.logs[0].fit_pct, abs=0.01)


def walks(random: Any) -> np.ndarray:
    return np.cumsum(0.004 * random.standard_normal(len(T)))


def lasts(random: Any) -> np.ndarray:
    return np.asarray(lfilter([0.01], [1, -0.99], random.standard_normal(len(T))))


@pytest.mark.slow
@pytest.mark.parametrize("noise", [walks, lasts])
def test_noise_that_lasts_jumps_nowhere(noise: Any) -> None:
    log = log_of(3)
    log["torque_nm"] += noise(np.random.default_rng(7))
    assert "zero-jumps" not in codes(eaid.fit(log))
