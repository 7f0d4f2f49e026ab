"""The public functions, as a notebook calls them: the same numbers as the command line, nothing printed."""

import json
import pickle
from pathlib import Path

import msgspec
import numpy as np
import pandas as pd
import pytest

import eaid
from eaid.cli.main import run
from eaid.errors import DataError, UsageError
from eaid.replay.tune import tune as tune_of_the_library
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.steps.stepset import StepSet

LEVELS = (20.0, 40.0, 60.0, 80.0, 100.0)


@pytest.fixture(scope="module")
def logs() -> StepSet:
    return eaid.synth(levels=LEVELS, repeats=2, rate_hz=100.0, seed=3)


@pytest.fixture(scope="module")
def fit(logs: StepSet) -> Fit:
    return eaid.fit(logs)


@pytest.fixture(scope="module")
def gains(fit: Fit) -> Gains:
    return eaid.tune_rc(fit)


def frames_of(logs: StepSet) -> dict[str, pd.DataFrame]:
    return {
        one.name: pd.DataFrame({"time_s": one.time_s, "duty_pct": one.input, "torque_nm": one.output})
        for one in logs.steps
        if one.edge == "rising"
    }


def test_the_public_names_are_there():
    wanted = {"read", "fit", "tune_rc", "simulate", "report", "plan", "synth", "load", "export", "couple", "FitOptions"}
    assert wanted <= set(dir(eaid))
    with pytest.raises(AttributeError):
        eaid.no_such_name  # noqa: B018


def test_a_function_stays_one_when_the_package_of_its_name_is_imported():
    import importlib

    for name in ("synth", "report", "export"):
        package = importlib.import_module(f"eaid.{name}")
        assert package.__name__ == f"eaid.{name}"
        assert callable(getattr(eaid, name))


def test_tables_and_files_give_the_same_fit(logs: StepSet, fit: Fit, tmp_path: Path):
    logs.save(tmp_path / "data.h5")
    from_file = eaid.fit(tmp_path / "data.h5")
    assert from_file.params.equals(fit.params)
    frames = frames_of(logs)
    named = eaid.fit(frames)
    one_table = eaid.fit(pd.concat([frame.assign(run=name) for name, frame in frames.items()]))
    assert named.params.equals(one_table.params)
    np.testing.assert_allclose(named.params["nonlinear"], fit.params["nonlinear"], rtol=1e-9)


def test_the_command_line_gives_the_same_numbers(logs: StepSet, fit: Fit, gains: Gains, tmp_path: Path):
    logs.save(tmp_path / "data.h5")
    assert run(["fit", str(tmp_path / "data.h5"), "-o", str(tmp_path / "fit.json"), "-q"]) == 0
    assert eaid.load(tmp_path / "fit.json").params.equals(fit.params)
    fit.save(tmp_path / "api.json")
    assert run(["tune-rc", str(tmp_path / "api.json"), "-o", str(tmp_path / "gains.json"), "-q"]) == 0
    loaded = eaid.load(tmp_path / "gains.json")
    assert isinstance(loaded, Gains)
    assert (loaded.rc, loaded.pi, loaded.margins) == (gains.rc, gains.pi, gains.margins)


def test_nothing_is_printed(logs: StepSet, fit: Fit, gains: Gains, capfd: pytest.CaptureFixture[str]):
    eaid.fit(logs, model=("linear",))
    eaid.tune_rc(fit)
    eaid.simulate(fit, gains, "multisine", duration=6.0)
    assert capfd.readouterr() == ("", "")


def test_a_fit_offers_pandas(fit: Fit):
    assert fit.params["linear", "a0"] == fit.linear_model.a0
    ends = fit.conf_int()
    assert (ends["low"] <= fit.params)[ends["low"].notna()].all()
    assert (ends["high"] >= fit.params)[ends["high"].notna()].all()
    assert list(fit.to_frame().index) == list(LEVELS)
    assert fit.to_frame()["fit_pct"].between(50, 100).all()
    shown = fit.predict(duty=60, t=[0, 1, 5])
    assert shown.iloc[0, 0] == 0
    assert shown.iloc[2, 0] == pytest.approx(fit.predict([40, 60], [5]).loc[5, 60.0])
    with pytest.raises(UsageError, match="knows the levels 20, 40"):
        fit.predict(55, [1], "friction")
    with pytest.raises(UsageError, match="duty= 101: the fit knows 20 … 100 % only"):
        fit.predict(101, [1])
    assert (fit.predict(60, [-1.0, 0.0]) == 0).all(axis=None)
    assert len(fit.summary().splitlines()) <= 10  # seven lines and three findings
    assert "<table" in fit._repr_html_()


def test_estimator_and_parameters_agree(logs: StepSet):
    joint, both = (eaid.fit(logs, eaid.FitOptions(estimator=name)) for name in ("joint", "two-stage"))
    assert (joint.nonlinear.estimator, both.nonlinear.estimator) == ("joint", "two-stage")
    assert both.plant.tau1 == both.nonlinear.tau1 != joint.nonlinear.tau1
    assert both.nonlinear.joint.tau1 == joint.nonlinear.tau1


def test_results_are_saved_loaded_and_pickled(logs: StepSet, fit: Fit, gains: Gains, tmp_path: Path):
    replay = eaid.simulate(fit, gains, "multisine", duration=6.0)
    walls = eaid.couple(fit, gains, replay=False, torques=(1.0,))
    for result, name in ((fit, "fit.json"), (gains, "gains.json"), (walls, "couple.json")):
        result.save(tmp_path / name)
        assert eaid.load(tmp_path / name) == result
        assert pickle.loads(pickle.dumps(result)) == result
        with pytest.raises(UsageError):
            result.save(tmp_path / name)
    replay.save(tmp_path / "replay.h5")
    back = eaid.load(tmp_path / "replay.h5")
    for name, record in replay.records.items():
        assert back.records[name].metrics == record.metrics
        for column, values in record.columns.items():
            np.testing.assert_array_equal(back.records[name].columns[column], values)
    assert pickle.loads(pickle.dumps(replay)).to_frame().equals(replay.to_frame())
    assert pickle.loads(pickle.dumps(logs)).to_frame().equals(logs.to_frame())


def test_a_plan_is_a_table_of_runs(fit: Fit):
    made = eaid.plan(fit, want={"Ts": 20.0, "tau1": 20.0, "tau2": 40.0}, check=False)
    assert made.met
    assert len(made.to_frame()) == len(made.levels) * made.repeats


def test_plots_are_axes(fit: Fit, gains: Gains):
    axes = fit.plot()
    assert len(axes.lines) == len(LEVELS)
    assert "N·m" in axes.get_ylabel()
    lines = eaid.simulate(fit, gains, "multisine", duration=6.0).plot().lines
    assert {line.get_label() for line in lines} == {"reference", "RC", "PI"}


def test_python_control_where_it_is_installed(fit: Fit, gains: Gains):
    control = pytest.importorskip("control")
    model = fit.linear.to_control()
    _t, y = control.step_response(model, np.linspace(0.0, 100.0, 1001))
    assert y[-1] == pytest.approx(fit.linear.b0 / fit.linear.a0)
    assert gains.to_control()["pi"].dcgain() == np.inf


def test_wrong_calls_are_told_in_words():
    with pytest.raises(UsageError, match="no such option robust: must be one of models"):
        eaid.fit({"a": pd.DataFrame()}, robust=True)
    with pytest.raises(DataError, match="no such file"):
        eaid.load("nowhere.json")
    with pytest.raises(UsageError, match="an empty path"):
        eaid.read("")


def test_a_sentence_may_be_reworded_without_any_number_changing(
    logs: StepSet, fit: Fit, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    """All sentences replaced by their codes: the same numbers, findings, gains and exit codes."""
    from eaid.findings.row import Row
    from eaid.findings.sentences import SENTENCES

    before = tune_of_the_library(fit)
    for code, row in list(SENTENCES.items()):
        monkeypatch.setitem(SENTENCES, code, Row(row.severity, code, row.size))
    again = eaid.fit(logs)
    assert again == fit
    assert tune_of_the_library(again) == before
    again.save(tmp_path / "fit.json")
    texts = [one["text"] for one in json.loads((tmp_path / "fit.json").read_text(encoding="utf-8"))["findings"]]
    assert texts
    assert all(text in SENTENCES or text.split(" (and ")[0] in SENTENCES for text in texts)


def test_where_the_model_has_no_interval_the_levels_speak_for_themselves(logs: StepSet):
    fit = eaid.fit(logs)
    assert fit.nonlinear is not None
    silent = [msgspec.structs.replace(row, ci95=None) for row in fit.nonlinear.curves]
    bare = msgspec.structs.replace(fit, nonlinear=msgspec.structs.replace(fit.nonlinear, curves=tuple(silent)))
    assert "taken  the" in fit.summary()
    assert "shown  each level's own curve" in bare.summary()
    own = bare.friction.levels[-1]
    assert f"{own.Ts:.3g} ({own.ci95.Ts[0]:.3g}" in bare.summary()


def test_steps_that_ask_for_a_dead_time_are_shown_with_it(tmp_path: Path):
    t = np.arange(0.0, 20.0, 0.02)
    rng = np.random.default_rng(1)
    logs = {
        f"u{u}": pd.DataFrame(
            {
                "time_s": t,
                "duty_pct": np.where(t >= 5, u, 0.0),
                "torque_nm": 0.03 * u * -np.expm1(-np.maximum(t - 5.5, 0) / 0.4) + 0.003 * rng.normal(size=t.size),
            }
        )
        for u in (20.0, 60.0, 100.0)
    }
    fit = eaid.fit(logs)
    assert [step.dead_time_s for step in fit.steps] == pytest.approx([0.5] * 3, abs=0.03)
    assert "shown  single steps by their own shapes" in fit.summary()
    row = next(line for line in fit.summary().splitlines() if line.startswith("0 → 100"))
    assert [float(cell) for cell in row.split()[3:5]] == pytest.approx([3.0, 0.4], rel=0.03)
    assert fit.findings[0].code == "other-shape-fits-better"


def test_an_empty_table_is_refused_by_its_cause():
    with pytest.raises(DataError, match="run: the DataFrame is empty"):
        eaid.fit(pd.DataFrame())
