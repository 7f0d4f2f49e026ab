"""The one verdict: what stops a run or a level leaves that out, and what fails in a model stops the fit."""

import msgspec
import numpy as np
import pandas as pd
import pytest

import eaid
from eaid.findings import finding, say

T = np.arange(0.0, 18.0, 0.04)
LEVELS = (20.0, 40.0, 60.0, 80.0, 100.0)


def run(level, seed, moves=True):
    """A step from rest at 2 s, held for 10 s, and its release."""
    draw, rise = np.random.default_rng(seed), 1 - 0.85 * np.exp(-(T - 2) / 0.4) - 0.15 * np.exp(-(T - 2) / 3)
    on = (T >= 2) & (T < 12)
    y = np.where(on, rise, np.where(T >= 12, np.exp(-np.maximum(T - 12, 0) / 0.3), 0.0))
    y = 5e-4 * level**2 * moves * (1 + 0.02 * draw.normal()) * y + 0.005 * draw.normal(size=len(T))
    return pd.DataFrame({"time_s": T, "duty_pct": np.where(on, level, 0.0), "torque_nm": y})


@pytest.fixture(scope="module")
def sound():
    return eaid.fit({f"u{u:g}r{k}": run(u, k) for u in LEVELS for k in range(2)})


def test_a_spike_in_one_release_stops_no_other_run(sound):
    logs = {f"u{u:g}r{k}": run(u, k) for u in LEVELS for k in range(2)}
    logs["u40r1"].loc[350, "torque_nm"] = 9.0
    fit = eaid.fit(logs, ci="none")
    told = next(one for one in fit.findings if one.code == "runs-left-out")
    assert fit.verdict.usable and told.values["runs"] == ("u40r1-release",) and told.severity == "caution"
    assert "u40r1-release" not in {one.run for one in fit.data.sources} and len(fit.data.sources) == 19
    assert fit.nonlinear.Ts == pytest.approx(sound.nonlinear.Ts, rel=1e-9)


@pytest.mark.slow
def test_a_level_that_does_not_move_is_left_out():
    fit = eaid.fit({f"u{u:g}": run(u, 1, moves=u > 20) for u in LEVELS}, ci="none")
    assert fit.verdict.usable and fit.data.levels == LEVELS[1:]
    assert {one.code: one.levels for one in fit.findings}["levels-left-out"] == (20.0,)
    alone = eaid.fit({"u20": run(20.0, 1, moves=False)})
    assert not alone.verdict.usable and alone.summary().startswith("NOT USABLE: ")


def changed(fit, part, **values):
    """With some numbers of a part changed, and the plant made of it anew."""
    return msgspec.structs.replace(fit, plant_=None, **{part: msgspec.structs.replace(getattr(fit, part), **values)})


def b0_within(fit, *ends):
    return msgspec.structs.replace(fit.linear.ci95, b0=ends)


def lost(fit):
    return msgspec.structs.replace(fit.linear.solver, converged=False)


def test_what_fails_in_a_model_and_what_does_not(sound):
    assert sound.verdict.usable and not sound.verdict.why
    wrong = {
        "fit-not-converged": changed(sound, "linear", solver=lost(sound)),
        "curve-of-no-plant": changed(sound, "nonlinear", tau1=(-0.1, 0.0, 0.0)),
        "steady-beyond-output": changed(sound, "nonlinear", tau1=(400.0, 0, 0), tau2=(900.0, 0, 0)),
        "linear-parameter-unknown": changed(sound, "linear", ci95=b0_within(sound, -0.01, 0.2)),
        "steady-output-unknown": changed(sound, "friction", levels=tuple(
            msgspec.structs.replace(row, ci95=msgspec.structs.replace(row.ci95, Ts=(0.01, 1.1)))
            for row in sound.friction.levels
        )),
    }  # fmt: skip
    for code, fit in wrong.items():
        (reason,) = fit.verdict.reasons
        assert reason.code == code and not fit.verdict.usable
        other = "nonlinear" if reason.subject == "linear" else "linear"
        assert fit.verdict.of(other).usable and not fit.verdict.of(reason.subject).usable


def test_a_gain_that_is_below_0_for_certain_is_said_to_be_that(sound):
    """A log whose input and output were exchanged: "anywhere between -374 and -374; record more levels"."""
    below = changed(sound, "linear", ci95=b0_within(sound, -374.04, -374.01))
    (reason,) = below.verdict.reasons
    assert "is below 0 (-374 … -374): more input gives less output; look for a log whose columns" in say(reason)


def test_a_plant_that_explains_no_level_or_not_its_own_logs_is_not_usable(sound):
    def played(*fit_pct):
        rows = tuple(msgspec.structs.replace(row, fit_pct=fit_pct[0]) for row in sound.data.replayed[:-1])
        last = msgspec.structs.replace(sound.data.replayed[-1], fit_pct=fit_pct[-1])
        return changed(sound, "data", replayed=(*rows, last))

    def missing(levels):
        told = finding("curve-misses-levels", "nonlinear", levels, fit_pct=-3.0, worst=20.0, repeats=True)
        return msgspec.structs.replace(sound, findings=(told,))

    for good in (played(5.0, -80.0), missing(LEVELS[1:])):
        assert good.verdict.usable
    assert missing(LEVELS[1:]).verdict.not_at == LEVELS[1:]
    for bad in (played(-5.0, 80.0), missing(LEVELS)):
        assert [one.code for one in bad.verdict.reasons] == ["model-explains-little"]
