"""What a notebook may type: every guessable name and call gives the right value, every wrong one a sentence."""

import importlib.util
import inspect
import math
import pickle
import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

import eaid
from eaid.declared import forms
from eaid.errors import DataError, UsageError

OPTIONS = {
    "read": "ReadOptions", "fit": "FitOptions", "tune_rc": "TuneOptions", "simulate": "SimulateOptions",
    "plan": "PlanOptions", "synth": "SynthOptions", "couple": "CoupleOptions", "export": "ExportOptions",
    "report": "ReportOptions",
}  # fmt: skip


@pytest.mark.parametrize("name", OPTIONS)
def test_every_option_stands_in_the_signature_with_its_default_and_in_the_help(name):
    function, kind = getattr(eaid, name), getattr(eaid, OPTIONS[name])
    shown = inspect.signature(function).parameters
    for option, form in forms(kind).items():
        assert shown[option].default == (None if option == "controller" else form.default)
        assert re.search(rf"\n{option}\b.*\n    ", function.__doc__)
    assert "keywords" not in shown and "**keywords" not in function.__doc__


def test_help_shows_names_where_python_would_show_objects():
    for function in (getattr(eaid, name) for name in (*OPTIONS, "sessions", "compare", "today")):
        assert not re.search(r"<function|object at 0x|-> '", str(inspect.signature(function)))


def test_editors_read_the_same_signatures():
    path = Path(__file__).parents[2] / "docs" / "stub.py"
    spec = importlib.util.spec_from_file_location("stub", path)
    assert spec is not None and spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    assert made.STUB.read_text(encoding="utf-8") == made.stub(), "run python docs/stub.py"


@pytest.fixture(scope="module")
def rig(small_steps, small_fit, small_gains, tmp_path_factory):
    """A fit, its gains and a replay, in memory and as files."""
    folder = tmp_path_factory.mktemp("notebook")
    run = eaid.simulate(small_fit, small_gains, "multisine", duration=3.0)
    small_fit.save(folder / "fit.json")
    small_gains.save(folder / "gains.json")
    run.save(folder / "run.h5")
    frames = [
        pd.DataFrame({"time_s": one.time_s, "duty_pct": one.input, "torque_nm": one.output})
        for one in small_steps.steps
        if one.edge == "rising"
    ]
    return SimpleNamespace(
        steps=small_steps, fit=small_fit, gains=small_gains, run=run, folder=folder, frames=frames,
        free=eaid.fit(small_steps, share="free", ci="none"),
        curves=eaid.fit(small_steps, model="friction", ci="none"),
    )  # fmt: skip


def of_means(rig, model="nonlinear"):
    """Averages of the repeats and what a model makes of them, worked out by `predict`."""
    fitted = [rig.fit.predict(one.level, one.time_s, model).to_numpy()[:, 0] for one in rig.steps.levels]
    return np.concatenate([one.mean for one in rig.steps.levels]), np.concatenate(fitted)


def likelihood(rig):
    """log L and n as statsmodels has them."""
    y, fitted = of_means(rig)
    n, sse = len(y), ((y - fitted) ** 2).sum()
    return -n / 2 * math.log(2 * math.pi) - n / 2 * math.log(sse / n) - n / 2, n


def r2(rig):
    y, fitted = of_means(rig)
    return 1 - ((y - fitted) ** 2).sum() / ((y - y.mean()) ** 2).sum()


def se_of_a0(rig):
    from scipy import stats

    (row,) = (one for one in rig.fit.parameters if (one.model, one.name, one.level) == ("linear", "a0", None))
    return (row.high - row.low) / 2 / stats.t.ppf(0.975, row.dof)


def arrays(rig, k=0):
    return [rig.frames[k][name].to_numpy() for name in ("time_s", "duty_pct", "torque_nm")]


def wave(t):
    return 1.0 + 0.2 * math.sin(t)


def proportional(_t, reference, output):
    return 30.0 * (reference - output)


def errors(run):
    return [one.rms_error_nm for one in run.metrics().values()]


def by_hand(rig):
    """The RMS error of a proportional controller, sample by sample."""
    from eaid.plant.dynamics import plant_numbers, plant_step

    plant, x1, x2, left = plant_numbers(rig.fit.plant), 0.0, 0.0, []
    for k in range(10_000):
        left.append(wave(k / 1000) - x1 - x2)
        x1, x2 = plant_step(plant, x1, x2, min(max(30.0 * left[-1], 0.0), 100.0), 1e-3)
    return float(np.sqrt(np.mean(np.square(left))))


# Free parameters of three levels: τ1 and τ2 are parabolas, T_s too (its cubic needs a fourth); 3 of the linear model
FREE = 9
LINEAR: dict[str, Any] = {"model": "linear", "ci": "none"}
Calls = dict[str, tuple[Callable[[Any], Any], Callable[[Any], Any]]]
GIVES: Calls = {
    "bse": (lambda r: r.fit.bse["linear", "a0"], se_of_a0),
    "bse of the covariance": (
        lambda r: r.fit.bse["nonlinear"][:FREE], lambda r: np.sqrt(np.diag(r.fit.cov_params()))[:FREE]),
    "cov_params": (lambda r: r.fit.cov_params().shape, lambda _: (10, 10)),
    "rsquared": (lambda r: r.fit.rsquared, r2),
    "aic": (lambda r: r.fit.aic, lambda r: 2 * FREE - 2 * likelihood(r)[0]),
    "bic": (lambda r: r.fit.bic, lambda r: FREE * math.log(likelihood(r)[1]) - 2 * likelihood(r)[0]),
    "aic of a file": (lambda r: eaid.load(r.folder / "fit.json").aic, lambda r: r.fit.aic),
    "k of a free share": (
        lambda r: r.free.bic - r.free.aic, lambda r: (FREE + 1) * (math.log(r.free.nobs) - 2)),
    "k of friction curves": (
        lambda r: r.curves.bic - r.curves.aic, lambda r: 9 * (math.log(r.curves.nobs) - 2)),
    "rmse": (lambda r: r.fit.rmse, lambda r: np.sqrt(np.mean(np.square(np.subtract(*of_means(r)))))),
    "nobs": (lambda r: r.fit.nobs, lambda r: sum(len(one.time_s) for one in r.steps.levels)),
    "resid": (lambda r: r.fit.resid.to_numpy(), lambda r: np.subtract(*of_means(r))),
    "fittedvalues": (lambda r: r.fit.fittedvalues.to_numpy(), lambda r: of_means(r)[1]),

    "verdict": (
        lambda r: repr(r.fit.verdict).startswith(f"usable; {len(r.fit.warnings)} warning") and bool(r.fit.verdict),
        lambda _: True),
    "to_dict": (lambda r: r.fit.to_dict()["linear"]["a0"], lambda r: r.fit.linear.a0),
    "to_dict of a replay": (
        lambda r: r.run.to_dict()["controllers"]["rc"]["rms_error_nm"],
        lambda r: r.run.metrics()["rc"].rms_error_nm),
    "gains.params": (lambda r: r.gains.params["rc", "B_hat"], lambda r: r.gains.rc.B_hat),
    "several frames": (lambda r: eaid.fit(r.frames, **LINEAR).linear.a0, lambda r: r.fit.linear.a0),
    "a dict of arrays": (
        lambda r: eaid.fit({name: r.frames[0][name].to_numpy() for name in r.frames[0]}, **LINEAR).linear.a0,
        lambda r: eaid.fit(r.frames[0], **LINEAR).linear.a0),
    "dicts of arrays by run": (
        lambda r: eaid.fit({f"r{k}": dict(one.items()) for k, one in enumerate(r.frames)}, **LINEAR).linear.a0,
        lambda r: r.fit.linear.a0),
    "three arrays": (
        lambda r: eaid.fit(*arrays(r), ci="none").friction.levels[0].tau1,
        lambda r: eaid.fit(r.frames[0], ci="none").friction.levels[0].tau1),

    "tune_rc of a file": (lambda r: eaid.tune_rc(r.folder / "fit.json").rc, lambda r: r.gains.rc),
    "tune_rc with an array": (
        lambda r: eaid.tune_rc(r.fit, reference=[(t, t / 3) for t in range(9)]).replayed.slope_nm_s,
        lambda _: 1 / 3),
    "simulate of files": (
        lambda r: errors(eaid.simulate(str(r.folder / "fit.json"), str(r.folder / "gains.json"), duration=3.0)),
        lambda r: errors(r.run)),
    "a reference over time": (
        lambda r: errors(eaid.simulate(r.fit, r.gains, reference=pd.Series([0.0, 2.0], index=[0.0, 4.0]))),
        lambda r: errors(eaid.simulate(r.fit, r.gains, reference=np.array([[0.0, 0.0], [1.0, 0.5], [4.0, 2.0]])))),
    "a reference by samples": (
        lambda r: errors(eaid.simulate(r.fit, r.gains, reference=[wave(k / 1000) for k in range(10_000)])),
        lambda r: errors(eaid.simulate(r.fit, r.gains, reference=wave))),
    "a function for so long": (
        lambda r: len(eaid.simulate(r.fit, r.gains, reference=wave, duration=2.0, controller="rc").to_frame()),
        lambda _: 2000),
    "a controller of one's own": (
        lambda r: errors(eaid.simulate(r.fit, reference=wave, controller=proportional)), lambda r: [by_hand(r)]),
    "one's own beside eaid's": (
        lambda r: list(eaid.simulate(r.fit, r.gains, "steps", controller=["rc", proportional], duration=9.0).records),
        lambda _: ["rc", "proportional"]),
    "a reference over timedeltas": (
        lambda r: errors(eaid.simulate(r.fit, r.gains, reference=pd.Series([0.0, 2.0], pd.to_timedelta([0, 4], "s")))),
        lambda r: errors(eaid.simulate(r.fit, r.gains, reference=pd.Series([0.0, 2.0], index=[0.0, 4.0])))),
    "an option as an array": (
        lambda r: eaid.tune_rc(r.fit, pi_gains=np.array([21.0, 360.0])).pi.K_I, lambda _: 360.0),
    "frames pickled with their fit": (
        lambda r: pickle.loads(pickle.dumps(eaid.fit(r.frames, ci="none"))).resid.to_numpy(),
        lambda r: eaid.fit(r.frames, ci="none").resid.to_numpy()),
    "report to a folder": (
        lambda r: eaid.report(r.fit, r.gains, r.run, to=r.folder / "a", figures="fig02").name, lambda _: "report.html"),
    "report of files": (
        lambda r: eaid.report(r.folder / "fit.json", r.folder / "b", figures="fig02").parent.name, lambda _: "b"),
}  # fmt: skip


@pytest.mark.parametrize("call", GIVES)
def test_a_notebook_gets(call, rig):
    typed, wanted = GIVES[call]
    value, right = typed(rig), wanted(rig)
    if isinstance(right, float | np.ndarray) or (isinstance(right, list) and not isinstance(right[0], str)):
        np.testing.assert_allclose(value, right, rtol=1e-6, atol=1e-12)
    else:
        assert value == right


WRONG: dict[str, tuple[Callable[[Any], Any], type[Exception], str]] = {
    "a misspelt option has a guess": (
        lambda r: eaid.fit(r.steps, **{"shares": 0.8}), UsageError, "did you mean share?"),
    "an option of read": (
        lambda r: eaid.fit(r.frames, **{"units": "time=ms"}), UsageError, "units=: says how logs are read"),
    "two arrays": (lambda r: eaid.fit(*arrays(r)[:2]), UsageError, "time, input and output as arrays"),
    "a model by place": (lambda r: eaid.fit(r.steps, "linear"), UsageError, "give FitOptions, or keywords"),
    "a scenario for gains": (lambda r: eaid.simulate(r.fit, "steps"), UsageError, "steps is a scenario="),
    "arrays of two lengths": (
        lambda r: eaid.fit(arrays(r)[0], arrays(r)[1], arrays(r)[2][1:]), DataError, "output of 1499; give as many"),
    "frames and a path": (lambda r: eaid.fit([r.frames[0], "logs"]), UsageError, "a list: give files or folders"),
    "an empty path": (lambda _: eaid.read(""), UsageError, "an empty path"),
    "an empty table": (lambda _: eaid.fit(pd.DataFrame()), DataError, "run: the DataFrame is empty"),
    "a level": (lambda r: r.fit.predict(55, [1], "friction"), UsageError, "knows the levels 20, 60"),
    "a duty": (lambda r: r.fit.predict(101, [1]), UsageError, "duty= 101: the fit knows 20 … 100 % only"),
    "a number": (lambda _: eaid.fit(3), UsageError, "files or folders of logs, a DataFrame, or DataFrames by name"),
    "gains as a fit": (lambda r: eaid.tune_rc(r.gains), UsageError, "a Gains; give what eaid.fit returns, or its file"),
    "a file of gains for a fit": (
        lambda r: eaid.tune_rc(r.folder / "gains.json"), UsageError, "gains.json holds Gains; give what eaid.fit"),
    "a fit for gains": (lambda r: eaid.simulate(r.fit, r.fit), UsageError, "gains: is a Fit; give what eaid.tune_rc"),
    "residuals of a file": (lambda r: eaid.load(r.folder / "fit.json").residuals, DataError, "fit again"),
    "a text for axes": (lambda r: r.fit.plot("duty"), UsageError, "ax= 'duty': is no drawing; 'residuals'"),
    "a frame to plot": (lambda r: eaid.plot(r.frames[0]), UsageError, "result: is a DataFrame"),
    "no folder": (lambda r: eaid.report(r.fit, r.gains), UsageError, "to=: name the folder of the page"),
    "a level in words": (lambda r: r.fit.at("high"), UsageError, "level= 'high': give a number"),
    "two alphas": (lambda r: r.fit.conf_int([0.1, 0.2]), UsageError, "alpha= [0.1, 0.2]: give a number"),
    "times in rows": (lambda r: r.fit.predict(60, [[0.0, 1.0]]), UsageError, "t= [[0.0, 1.0]]: give numbers"),
    "a reference beyond any rig": (
        lambda r: eaid.simulate(r.fit, reference=[1e300, 1e300]), UsageError, "give finite numbers"),
    "a falling reference": (
        lambda r: eaid.simulate(r.fit, reference=pd.Series([0.0, 1.0], index=[1.0, 0.0])), UsageError,
        "time that rises"),
    "a controller of nothing": (
        lambda r: eaid.simulate(r.fit, controller=lambda t, reference, output: None), UsageError,
        "controller lambda: gave None at 0 s"),
    "one's own on drawn plants": (
        lambda r: eaid.simulate(r.fit, controller=proportional, plants=3), UsageError, "does not go with plants="),
    "whole options of another kind": (
        lambda r: eaid.tune_rc(r.fit, eaid.FitOptions()), UsageError, "give TuneOptions, or keywords"),
}  # fmt: skip


@pytest.mark.parametrize("call", WRONG)
def test_a_wrong_call_is_one_sentence(call, rig):
    made, error, said = WRONG[call]
    with pytest.raises(error, match=re.escape(said)) as raised:
        made(rig)
    assert len(str(raised.value)) < 300 and "\n" not in str(raised.value)


def test_python_control_gets_the_plant(rig):
    control = pytest.importorskip("control")
    plant = rig.fit.plant.to_control(at=60)
    (tau1, tau2), poles = rig.fit.plant.time_constants(60.0), sorted(plant.poles().real)
    assert poles == pytest.approx([-1 / tau1, -1 / tau2])
    assert control.dcgain(plant) == pytest.approx((rig.fit.plant.steady(60.01) - rig.fit.plant.steady(59.99)) / 0.02)
    assert control.dcgain(rig.fit.linear.to_control()) == pytest.approx(rig.fit.linear.b0 / rig.fit.linear.a0)


SHELL = re.compile(r"(^|\s)--[a-z]|eaid (fit|tune-rc|ingest|simulate|report|plan|export)\b")


def test_advice_in_a_notebook_is_python(rig):
    poor = eaid.fit([rig.frames[0]], ci="none")
    told = [poor.summary(), rig.fit.summary(), rig.gains.summary(), rig.run.summary(), *poor.warnings]
    assert [text for text in told if SHELL.search(text)] == []
