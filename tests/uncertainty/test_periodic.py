"""The periodic part of the ripple: found where there is one, and its weight in the parameters by a second way."""

from typing import Any

import numpy as np
import pytest

from eaid.models import friction
from eaid.models.parameters import Friction
from eaid.steps.stepset import Level
from eaid.uncertainty.level_statistics import statistics_at_share
from eaid.uncertainty.levels import log_jacobian
from eaid.uncertainty.periodic import Periodic, periodic_part
from eaid.uncertainty.rig_noise import noise_of, noise_of_fit

CURVE = Friction(2.0, 0.5, 8.0, 0.85)


def levels_with(random: np.random.Generator, amplitude: float, period_s: float, record_s: float) -> tuple[Level, ...]:
    """Eight levels of three runs, white noise and a sine of any phase."""
    t = np.arange(round(50 * record_s)) / 50
    made = []
    for u in range(8):
        curve = Friction(1 + u, 0.5, 8.0, 0.85)
        f = friction.step_response(curve, t)
        phase = random.uniform(0, 2 * np.pi, (3, 1))
        runs = f * (1 + amplitude * np.sin(2 * np.pi * t / period_s + phase)) + 0.02 * random.standard_normal(
            (3, t.size)
        )
        made.append(Level(10.0 + u, t, runs, ("a", "b", "c")))
    return tuple(made)


@pytest.mark.parametrize(("period_s", "record_s"), [(6.0, 20.0), (1.7, 20.0), (4.0, 30.0)])
def test_period_and_amplitude_return(period_s: float, record_s: float) -> None:
    base = statistics_at_share(levels_with(np.random.default_rng(4), 0.02, period_s, record_s), 0.85)
    found = periodic_part(base.levels, base.estimates)
    assert found is not None
    assert found[0].period_s == pytest.approx(period_s, rel=0.03)
    assert found[0].amplitude == pytest.approx(0.02, rel=0.15)
    # what is left is the white noise: S = 0.02²/50 a second at every level
    assert np.mean(found[1]) == pytest.approx(0.02**2 / 50, rel=0.1)


@pytest.mark.parametrize("seed", range(6))
def test_none_is_told_where_there_is_none(seed: int) -> None:
    base = statistics_at_share(levels_with(np.random.default_rng(seed), 0.0, 6.0, 20.0), 0.85)
    assert periodic_part(base.levels, base.estimates) is None


def test_records_of_less_than_two_turns_tell_none() -> None:
    base = statistics_at_share(levels_with(np.random.default_rng(4), 0.05, 1.5, 1.9), 0.85)
    assert periodic_part(base.levels, base.estimates) is None


@pytest.mark.parametrize("hold_s", [12.0, 21.0, 60.0])
def test_its_variance_is_that_of_fits_to_sines_of_all_phases(hold_s: float) -> None:
    t = np.arange(round(200 * hold_s)) / 200 + 0.0025
    J = log_jacobian(CURVE, t)
    phases = np.linspace(0, 2 * np.pi, 64, endpoint=False)[:, None]
    runs = friction.step_response(CURVE, t) * 0.01 * np.sin(2 * np.pi * t / 6 + phases)
    moved = np.linalg.lstsq(J, runs.T, rcond=None)[0]
    assert Periodic(6.0, 0.01).variance(CURVE, hold_s) == pytest.approx(np.mean(moved**2, axis=1), rel=0.02)


def test_the_fit_keeps_it_beside_the_noise(sets: Any) -> None:
    """Runs of the benchmark: rotor ripple of 1 % at 6 s, the rest 1 % with 0.05 s, S = 2 · 0.05 · 0.01²."""
    base = statistics_at_share(sets.one_set(3, sets.VARIANTS["base"]).levels, 0.85)
    noise = noise_of(base, 1e-6)
    assert noise.periodic is not None and noise.periodic.period_s == pytest.approx(6.0, rel=0.03)
    assert noise.periodic.amplitude_pct == pytest.approx(1.0, rel=0.1)
    assert noise.ripple_s > 2e-5
    assert noise.periodic.beside.ripple_s == pytest.approx(1e-5, rel=0.2)
    assert noise.periodic.beside.scatter["tau2"] <= noise.scatter["tau2"]


def test_a_plan_counts_it_apart(sets: Any) -> None:
    from eaid.fitting.fit import fit
    from eaid.uncertainty.intervals import with_intervals

    made = sets.one_set(3, sets.VARIANTS["base"])
    found = with_intervals(made, fit(made))
    whole, apart = noise_of_fit(found), noise_of_fit(found, apart=True)
    assert whole is not None and apart is not None and whole.periodic is None and apart.periodic is not None
    assert apart.ripple_s < whole.ripple_s
    # a sine loses its weight faster with the hold than white noise does
    short, long = (apart.within(CURVE, hold)[2] / whole.within(CURVE, hold)[2] for hold in (12.0, 60.0))
    assert short > 1.5 * long
