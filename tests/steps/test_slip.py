"""Slip tests by formula: peak, level after it, loading stiffness, stick-slip."""

import numpy as np
import pytest

from eaid.steps.slip import slip_of

T = np.arange(6000) / 2000


def loaded(noise: float = 0.0, seed: int = 0) -> np.ndarray:
    """0.8 per s up to 0.4 at 0.5 s, then down to 0.3 with 0.2 s."""
    y = np.where(T < 0.5, 0.8 * T, 0.3 + 0.1 * np.exp(-(T - 0.5) / 0.2))
    return np.asarray(y + noise * np.random.default_rng(seed).normal(size=T.size))


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_peak_level_and_stiffness(noise: float) -> None:
    slip = slip_of(T, loaded(noise))
    assert slip is not None
    assert slip.peak == pytest.approx(0.4, rel=0.03)
    assert slip.peak_s == pytest.approx(0.5, abs=0.03)
    assert slip.after == pytest.approx(0.3, rel=0.01)
    assert slip.stiffness_per_s == pytest.approx(0.8, rel=0.03)
    assert slip.moved is None and slip.stiffness is None
    pulled = slip_of(T, loaded(noise), 7.0 + 0.5 * T)  # at 0.5 mm/s
    assert pulled is not None and pulled.moved is not None
    assert pulled.moved == pytest.approx(0.25, rel=0.06)
    assert pulled.stiffness == pytest.approx(1.6, rel=0.03)
    assert slip.stick_slip is None and slip.stick_slip_hz is None


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_stick_slip(noise: float) -> None:
    saw = 0.06 * ((18 * T) % 1.0 - 0.5)
    slip = slip_of(T, loaded(noise) + np.where(T > 0.6, saw, 0.0))
    assert slip is not None and slip.stick_slip is not None
    assert slip.stick_slip_hz == pytest.approx(18, rel=0.05)
    assert slip.stick_slip == pytest.approx(0.06 * 2 / np.pi, rel=0.15)  # the sine within the saw


def test_a_settling_step_does_not_slip() -> None:
    for seed in range(20):
        assert slip_of(T, 1 - np.exp(-T / 0.2) + 0.02 * np.random.default_rng(seed).normal(size=T.size)) is None
