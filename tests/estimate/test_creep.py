"""A C of the runs' own, an output that creeps at one rate beside its response, a response that fades: told apart."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import eaid
from benchmarks.coverage import VARIANTS, one_set

LEVELS = (2.0, 4.0, 6.0, 8.0, 10.0)


def logs(
    C: float, creep: float = 0.0, while_idle: bool = True, seed: int = 0, repeats: int = 3, idle_s: float = 2.0,
    fade: float = 0.0, hold_s: float = 15.0, names: tuple[str, str] = ("input_V", "output_N"),
) -> list[pd.DataFrame]:  # fmt: skip
    """T_s = 0.2 u + 0.03 u², τ 0.3 and 5 s; gains that scatter by 4 % and τ by 2 %, noise of 0.02 N; creep in N/s, a
    fade in parts of the response a second."""
    random, found = np.random.default_rng(seed), []
    t = np.arange(0.0, idle_s + hold_s, 0.02)
    s = np.maximum(t - idle_s, 0.0)
    for u in LEVELS if repeats > 1 else np.linspace(1.0, 10.0, 10):
        for _ in range(repeats):
            tau = np.array([0.3, 5.0]) * (1 + 0.02 * random.normal())
            size = (0.2 * u + 0.03 * u * u) * (1 + 0.04 * random.normal()) * (1 - fade * s)
            y = size * -(C * np.expm1(-s / tau[0]) + (1 - C) * np.expm1(-s / tau[1]))
            y += creep * (t if while_idle else s) + 0.02 * random.normal(size=len(t))
            found.append(pd.DataFrame({"time_s": t, names[0]: np.where(t >= idle_s, u, 0.0), names[1]: y}))
    return found


@pytest.mark.slow
def test_each_run_creeps_from_the_rest_that_it_is_counted_from() -> None:
    """A low level is counted from the last part of its idle time, a high one from the mean of all of it: T_s of the low
    ones was 5 % low, beyond its interval."""
    fit = eaid.fit(eaid.read(dict(enumerate(logs(0.85, 0.006, idle_s=12.0)))))
    assert "creep-taken-off" in {one.code for one in fit.findings}
    rests = [one.rest_s for one in fit.samples.steps.level_steps if one.from_level == 0]
    assert max(rests) > 2 * min(rests)
    assert within(fit) >= 13
    low, high = fit.at(LEVELS[0]).loc["Ts", ["low", "high"]]
    assert low < 0.52 < high


def within(fit: eaid.Fit) -> int:
    """How many of the fifteen values of the levels lie in their intervals."""
    count = 0
    for u in LEVELS:
        at = fit.at(u)
        for name, true in (("Ts", 0.2 * u + 0.03 * u * u), ("tau1", 0.3), ("tau2", 5.0)):
            _, low, high = at.loc[name]
            count += low <= true <= high
    return count


def played(fit: eaid.Fit) -> list[float | None]:
    return [one.fit_pct for one in fit.data.replayed]


@pytest.mark.parametrize(
    ("C", "creep"),
    [
        (0.85, 0.006),
        (0.85, 0.0),
        *(pytest.param(*one, marks=pytest.mark.slow) for one in ((0.75, 0.0), (0.78, -0.006))),
    ],
)
def test_what_is_there_is_found_and_no_more(C: float, creep: float, tmp_path: Path) -> None:
    """A creep of 2 % of the highest output in a hold was taken for a C of 0.75, and τ2 was a half."""
    for k, log in enumerate(logs(C, creep), 10):
        log.to_csv(tmp_path / f"{k}.csv", index=False)
    fit = eaid.fit(tmp_path)
    codes = {one.code: one.values for one in fit.findings}
    assert ("share-by-evidence" in codes) == (C != 0.85) and ("creep-taken-off" in codes) == bool(creep)
    assert fit.verdict.usable and pytest.approx(C, abs=0.01) == fit.plant.C
    if creep:
        assert codes["creep-taken-off"]["low"] < creep < codes["creep-taken-off"]["high"]
        assert fit.residuals.std() == pytest.approx(fit.rmse, rel=0.02)  # neither has the creep
        assert played(fit) == pytest.approx(played(eaid.fit(logs(C), ci="none")), abs=0.1)
        again = eaid.simulate(fit, log=tmp_path)
        assert [one.metrics.fit_pct for one in again.records.values()] == played(fit)
        assert "log-without-creep" in {one.code for one in again.findings}
    assert within(fit) >= 13
    assert not {"output-creeps", "share-free", "runs-reject-the-share"} & set(codes)


@pytest.mark.slow
def test_what_does_not_idle_so_is_no_creep() -> None:
    assert "creep-taken-off" not in {
        one.code for one in eaid.fit(logs(0.85, 0.006, while_idle=False), ci="none").findings
    }


def test_a_share_that_somebody_holds_is_held() -> None:
    fit = eaid.fit(logs(0.75), share=0.8)
    assert fit.plant.C == 0.8 and "runs-reject-the-share" in {one.code for one in fit.findings}


@pytest.mark.slow
def test_values_do_not_go_with_the_intervals_that_are_asked_for() -> None:
    for C, creep in ((0.75, 0.0), (0.85, 0.006)):
        with_them, without = (eaid.fit(logs(C, creep), ci=ci).plant for ci in ("robust", "none"))
        assert without == with_them


@pytest.mark.slow
@pytest.mark.parametrize(("C", "creep"), [(0.85, 0.01), (0.85, 0.0), (0.9, 0.0)])
def test_single_runs_tell_a_creep_by_their_levels(C: float, creep: float) -> None:
    """3 % of the highest output in a hold made τ1 of the lowest level half as long again, and T_s a sixth too large."""
    fit = eaid.fit(logs(C, creep, repeats=1), ci="none")
    told = {one.code: one.values for one in fit.findings}
    assert ("creep-taken-off" in told) == bool(creep)
    if creep:
        assert told["creep-taken-off"]["rate"] == pytest.approx(creep, rel=0.1)
        assert fit.at(1.0).loc["tau1", "value"] == pytest.approx(0.3, rel=0.15)


def test_single_runs_of_a_coarse_sensor_tell_their_share() -> None:
    """Its steps were taken for noise that lasts, C stayed at 0.85: τ1 was 0.71 (0.62 … 0.81) s, "usable yes"."""
    random, found = np.random.default_rng(3), []
    t = np.arange(0.0, 22.0, 0.02)
    s = np.maximum(t - 2.0, 0.0)
    rise = 1 - 0.6 * np.exp(-s / 0.3) - 0.4 * np.exp(-s / 4)
    for u in LEVELS:
        y = (0.2 * u + 0.03 * u * u) * (1 + 0.02 * random.normal()) * rise
        seen = 0.02 * np.round(y / 0.02 + 0.1 * random.normal(size=len(s)))
        found.append(pd.DataFrame({"time_s": t, "input_V": np.where(s > 0, u, 0.0), "output_N": seen}))
    fit = eaid.fit(eaid.read(dict(enumerate(found))))
    assert abs(fit.plant.C - 0.6) < 0.02
    for u in LEVELS[1:]:
        _, low, high = fit.at(u).loc["tau1"]
        assert low < 0.3 < high < 0.4


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 5])
def test_another_c_is_no_creep_where_the_idle_time_is_too_short_to_tell(seed: int) -> None:
    """Of the reference plant with C of 0.88: a creep was taken off, T_s held its truth in 56 of 100, τ2 in 44."""
    fit = eaid.fit(one_set(seed, VARIANTS["share"]))
    codes = {one.code for one in fit.findings}
    assert "share-by-evidence" in codes and "creep-taken-off" not in codes


def faded(fade: float, C: float = 0.85, **more: Any) -> list[pd.DataFrame]:
    """Logs that are held twice as long."""
    return logs(C, seed=1, fade=fade, hold_s=30.0, **more)


@pytest.mark.slow
def test_a_fade_in_proportion_is_taken_off(tmp_path: Path) -> None:
    """One of 3 % in 30 s made τ2 a third too short, ± 1 %, and C another, "usable"."""
    for k, log in enumerate(faded(0.001), 10):
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
    assert [one.metrics.fit_pct for one in again.records.values()] == played(fit)
    assert played(fit) == pytest.approx(played(eaid.fit(faded(0.0), ci="none")), abs=0.5)


@pytest.mark.slow
def test_another_share_is_no_fade() -> None:
    fit = eaid.fit(faded(0.0, C=0.9), ci="none")
    assert not {"fade-taken-off", "fade-possible"} & {one.code for one in fit.findings}
    assert pytest.approx(0.9, abs=0.01) == fit.plant.C


@pytest.mark.slow
def test_friction_fades_too() -> None:
    """A friction rig's levels, each by itself, have no polynomials."""
    fit = eaid.fit(faded(0.001, names=("normal_force_N", "torque_Nm")), ci="none")
    assert "fade-taken-off" in {one.code for one in fit.findings}
    assert fit.at(6.0).loc["tau2", "value"] == pytest.approx(5.0, rel=0.05)
