"""Sweeps whose rests are too short: steps begin on what those before have left."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import eaid
from benchmarks import coverage
from eaid.plant.dynamics import REFERENCE_PLANT, Plant

CLUTCH = Plant((0.40, -0.0015), (12.0, -0.06), (0.3, 0.009, 0.00029), (10.0, 100.0))
RELEASES = {
    "as the input left": replace(CLUTCH, release=(0.3, 8.0), release_as_left=True),
    "one pair": replace(CLUTCH, release=(0.3, 7.0)),
}
LEVELS = np.array([10.0, 25.0, 40.0, 55.0, 70.0, 85.0, 100.0])


def sweep(plant: Plant, order: np.ndarray, rest_s: float, scatter: float, random: np.random.Generator) -> pd.DataFrame:
    """Levels held for 20 s, each with a gain of its own; two states in parallel, hold by hold."""
    x, left, parts = np.zeros(2), 10.0, [(0.0, np.full(250, 0.05))]
    for u in np.ravel([order, 0 * order], order="F"):
        taus = plant.time_constants(u or left) if u or plant.release_as_left else plant.release
        target = (1 + scatter * random.normal()) * plant.at(u).Ts * np.array([plant.C, 1 - plant.C])
        t = np.arange(round(50 * (20.0 if u else rest_s)) + 1) / 50
        states = target + (x - target) * np.exp(-t[:, None] / np.array(taus, dtype=float))
        x, left = states[-1], u or left
        parts.append((u, 0.05 + states[:-1].sum(axis=1)))
    held, outputs = zip(*parts, strict=True)
    y = np.concatenate(outputs)
    duty = np.repeat(held, [len(one) for one in outputs])
    torque = y + 0.004 * random.normal(size=len(y))
    return pd.DataFrame({"time_s": np.arange(len(y)) / 50, "duty_pct": duty, "torque_nm": torque})


def of_sweeps(plant: Plant, rest_s: float, scatter: float = 0.01, **options) -> eaid.Fit:
    """Of three sweeps, up, down and up."""
    random, orders = np.random.default_rng(5), (LEVELS, LEVELS[::-1], LEVELS)
    logs = {f"sweep{k}": sweep(plant, order, rest_s, scatter, random) for k, order in enumerate(orders)}
    return eaid.fit(eaid.read(logs, **options))


@pytest.mark.parametrize(
    ("name", "rest_s"),
    [("as the input left", 5.0), ("one pair", 5.0), pytest.param("one pair", 20.0, marks=pytest.mark.slow)],
)
def test_tails_are_taken_off_steps(name: str, rest_s: float) -> None:
    """A tail of 100 % is as large as a fifth of the output at 10 %: T_s was 2 to 10 % low there, τ2 off by a third."""
    plant = RELEASES[name]
    fit = of_sweeps(plant, rest_s)
    assert fit.recorded is None
    assert "tails-taken-off" in {one.code for one in fit.findings}
    for row in fit.friction_levels:
        true = plant.at(row.level)
        assert row.Ts == pytest.approx(true.Ts, rel=0.02)
        assert row.tau1 == pytest.approx(true.tau1, rel=0.01)
        assert row.tau2 == pytest.approx(true.tau2, rel=0.03)
    assert fit.release is not None
    assert fit.plant.release_as_left is fit.release.as_left is plant.release_as_left
    if not plant.release_as_left:
        assert (fit.release.tau1, fit.release.tau2) == pytest.approx(plant.release, rel=0.01)
    assert all((one.fit_pct or 0.0) > 97 for one in fit.data.replayed)
    ended = 1 - 0.15 * np.exp(-19 / plant.at(row.level).tau2)  # of the steps without their tails
    assert fit.responses[-1].held == pytest.approx(ended * row.Ts, rel=0.01)
    if rest_s == 5.0:  # the falls are without them, too: from 100 % they took 1.6 s, from 10 % 0.35 s
        for one in fit.responses:
            fast, slow = plant.time_constants(one.level) if plant.release_as_left else plant.release
            rose, t = plant.at(one.level), np.arange(0.0, 5.0, 0.001)
            left = 0.85 * np.exp(-t / fast) + 0.15 * (1 - np.exp(-20 / rose.tau2)) * np.exp(-t / slow)
            held = 1 - 0.15 * np.exp(-19 / rose.tau2)
            assert one.released_s == pytest.approx(0.001 * (left > 0.1 * held).sum(), rel=0.1)


def test_rests_that_last_leave_nothing_to_take_off() -> None:
    fit = of_sweeps(RELEASES["one pair"], 60.0)
    assert "tails-taken-off" not in {one.code for one in fit.findings}


@pytest.mark.slow
def test_logs_as_recorded_fall_as_the_input_that_was_left() -> None:
    """One pair of constants for all falls made τ2 100 % too long at one end and 40 % too short in the middle."""
    plant = RELEASES["as the input left"]
    fit = of_sweeps(plant, 8.0, scatter=0.0, logs_as="recorded")
    assert fit.recorded is not None
    assert fit.plant.release_as_left
    assert "release-as-left" in {one.code for one in fit.findings}
    for row in fit.friction_levels:
        true = plant.at(row.level)
        assert (row.Ts, row.tau1, row.tau2) == pytest.approx((true.Ts, true.tau1, true.tau2), rel=0.01)
    own = of_sweeps(RELEASES["one pair"], 8.0, scatter=0.0, logs_as="recorded")
    assert not own.plant.release_as_left
    assert own.plant.release == pytest.approx((0.3, 7.0), rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("C", "dead_time_s"), [(1.0, 0.0), (1.2, 0.0), (0.85, 0.2)])
def test_sweeps_of_other_plants_are_fitted_as_recorded(C: float, dead_time_s: float) -> None:
    """T_s was 15 to 40 % too large, by a slow part that never comes, or an overshoot that was taken for a creep."""
    plant = replace(CLUTCH, C=C)
    random, left = np.random.default_rng(3), replace(plant, release_as_left=True)
    logs = {k: sweep(left, random.permutation(LEVELS), 5.0, 0.005, random) for k in range(2)}
    for log in logs.values():
        log["torque_nm"] = np.append(np.full(round(50 * dead_time_s), 0.05), log["torque_nm"])[: len(log)]
    fit = eaid.fit(eaid.read(logs))
    assert fit.recorded is not None
    assert fit.plant.kind == plant.kind
    assert fit.plant.release_as_left
    assert fit.plant.dead_time_s == pytest.approx(dead_time_s, abs=0.005)
    assert pytest.approx(plant.C, abs=0.01) == fit.plant.C
    for u in LEVELS:
        assert float(fit.plant.steady(u)) == pytest.approx(plant.at(u).Ts, rel=0.03)
        assert float(fit.plant.time_constants(u)[0]) == pytest.approx(plant.at(u).tau1, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2, 3))])
def test_tails_as_large_as_the_steps_that_begin_on_them(seed: int) -> None:
    """Rests of 5 s in any order: a tail of 100 % is twice the output at 10 %. It was taken for one that ran away, and
    the logs were fitted as recorded, τ2 18 % off at 50 % (σ of 16 sets; now 6)."""
    random = np.random.default_rng([seed, 20270])
    fit = eaid.fit(eaid.read({str(k): pd.DataFrame(coverage.sweep(random, 5.0)) for k in range(3)}))
    assert fit.recorded is None and fit.on_tails
    assert "repeat-is-off" not in {one.code for one in fit.findings}  # a run lies off by its tail
    held = []
    for row in fit.friction_levels:
        true = REFERENCE_PLANT.at(row.level)
        assert row.Ts == pytest.approx(true.Ts, rel=0.05)
        assert row.tau2 == pytest.approx(true.tau2, rel=0.14)
        assert row.ci95 is not None and row.ci95.tau2 is not None
        held.append(row.ci95.tau2[0] < true.tau2 < row.ci95.tau2[1])
    assert sum(held) >= 8


@pytest.mark.slow
@pytest.mark.parametrize("seed", [7, 2, 4])
def test_one_sweep_whose_gains_scatter(seed: int) -> None:
    """One gain a level: the fit broke off, left a level out, or had τ2 7 half-widths off. Of seed 7 a level remains
    below its tail, and the log is fitted as recorded."""
    log = pd.DataFrame(coverage.sweep(np.random.default_rng([seed, 20270]), 5.0))
    fit = eaid.fit(eaid.read({"one": log}))
    assert (fit.recorded is not None) is (seed == 7)
    for row in fit.friction_levels:
        true = REFERENCE_PLANT.at(row.level)
        assert row.Ts == pytest.approx(true.Ts, rel=0.07)  # gains scatter by 2 %
        assert row.tau2 == pytest.approx(true.tau2, rel=0.25 if row.level == 10 else 0.15)
        if seed != 7 and row.level > 10:
            assert row.ci95 is not None and row.ci95.Ts is not None
            assert row.ci95.Ts[0] < true.Ts < row.ci95.Ts[1]
