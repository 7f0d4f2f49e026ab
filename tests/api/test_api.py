"""The public functions, as a notebook calls them: the same numbers as the command line, nothing printed."""

import importlib
import json
import pickle

import numpy as np
import pandas as pd
import pytest

import eaid
from eaid.errors import DataError, UsageError
from eaid.findings.sentences import SENTENCES

LEVELS = [20.0, 60.0, 100.0]
PUBLIC = {"read", "fit", "tune_rc", "simulate", "report", "plan", "synth", "load", "export", "couple", "FitOptions"}


def test_the_public_names_are_there_and_stay_functions():
    assert set(dir(eaid)) >= PUBLIC
    with pytest.raises(AttributeError):
        getattr(eaid, "no_such_name")  # noqa: B009
    for name in ("synth", "report", "export"):
        assert importlib.import_module(f"eaid.{name}").__name__ == f"eaid.{name}"
        assert callable(getattr(eaid, name))


def test_the_command_line_gives_the_same_numbers(small_steps, small_fit, small_gains, tmp_path, run_eaid):
    small_steps.save(tmp_path / "data.h5")
    assert run_eaid("fit", tmp_path / "data.h5", "-o", tmp_path / "fit.json", "-q").code == 0
    assert eaid.load(tmp_path / "fit.json").params.equals(small_fit.params)
    small_fit.save(tmp_path / "api.json")
    assert run_eaid("tune-rc", tmp_path / "api.json", "-o", tmp_path / "gains.json", "-q").code == 0
    loaded = eaid.load(tmp_path / "gains.json")
    assert (loaded.rc, loaded.pi, loaded.margins) == (small_gains.rc, small_gains.pi, small_gains.margins)


def test_a_fit_offers_pandas(small_fit):
    fit, ends = small_fit, small_fit.conf_int()
    assert fit.params["linear", "a0"] == fit.linear.a0
    assert (ends["low"] <= fit.params)[ends["low"].notna()].all()
    assert (ends["high"] >= fit.params)[ends["high"].notna()].all()
    assert list(fit.to_frame().index) == LEVELS and fit.to_frame()["fit_pct"].between(50, 100).all()
    shown = fit.predict(duty=60, t=[0, 1, 5])
    assert shown.iloc[0, 0] == 0
    assert shown.iloc[2, 0] == pytest.approx(fit.predict([40, 60], [5]).loc[5, 60.0])
    assert (fit.predict(60, [-1.0, 0.0]) == 0).all(axis=None)
    assert "usable yes, warned: " in fit.summary()
    assert "not estimable" not in eaid.fit(fit.samples.steps, ci="none").summary()
    assert fit.predict(60, 5.0).equals(fit.predict(60, [5]))
    assert fit.predict(60, pd.to_timedelta([0.5, 5.0], unit="s")).equals(fit.predict(60, [0.5, 5.0]))
    assert len(fit.summary().splitlines()) <= 11  # eight lines and three findings
    assert "<table" in fit._repr_html_()


def test_one_value_a_level_whatever_surface_tells_it(small_fit):
    fit, level = small_fit, LEVELS[1]
    row, curve = fit.friction.levels[1], fit.nonlinear.curves[1]
    known = fit.at(level)
    for name in ("Ts", "tau1", "tau2"):
        assert known.loc[name, "value"] == getattr(row, name) == getattr(curve, name)
        assert fit.params["friction", f"{name}({level:g})"] == getattr(row, name)
        assert (known.loc[name, "low"], known.loc[name, "high"]) == getattr(row.ci95, name) == getattr(curve.ci95, name)
    assert fit.predict(level, [1e6]).iloc[0, 0] == pytest.approx(curve.Ts, rel=1e-12)
    assert f"{curve.Ts:.3g} ({curve.ci95.Ts[0]:.3g}" in fit.summary()
    between = fit.at(0.5 * (LEVELS[1] + LEVELS[2]))
    assert (between["low"] < between["value"]).all() and (between["value"] < between["high"]).all()
    with pytest.raises(UsageError, match="the fit knows"):
        fit.at(2 * max(LEVELS))


def test_the_table_of_parameters_has_every_interval_and_the_others_follow(small_fit, run_eaid, tmp_path):
    from scipy import stats

    fit = small_fit
    (row,) = [one for one in fit.parameters if (one.model, one.name) == ("linear", "a0") and one.level is None]
    t = [stats.t.ppf(1 - a / 2, row.dof) for a in (0.05, 0.5)]
    half = fit.conf_int(0.5).loc[("linear", "a0")]
    assert (row.low, row.high) == fit.linear.ci95.a0 == tuple(fit.conf_int().loc[("linear", "a0")])
    assert half["high"] == pytest.approx(row.value + (row.high - row.value) * t[1] / t[0])  # an even interval
    (row,) = [one for one in fit.parameters if (one.model, one.name, one.level) == ("friction", "tau1", LEVELS[1])]
    t, ends = [stats.t.ppf(1 - a / 2, row.dof) for a in (0.05, 0.5)], fit.conf_int(0.5)
    high = row.value * (row.high / row.value) ** (t[1] / t[0])  # one that is even on the logarithm
    assert ends.loc[("friction", f"tau1({LEVELS[1]:g})"), "high"] == pytest.approx(high)
    with pytest.raises(UsageError):
        fit.conf_int(alpha=2)
    fit.save(tmp_path / "fit.json")
    assert eaid.load(tmp_path / "fit.json").at(LEVELS[0]).equals(fit.at(LEVELS[0]))
    text = (tmp_path / "fit.json").read_text(encoding="utf-8").replace("eaid/fit/2", "eaid/fit/1")
    (tmp_path / "old.json").write_text(text, encoding="utf-8")
    with pytest.raises(DataError, match="is an eaid/fit/1 file; make it again"):
        eaid.load(tmp_path / "old.json")
    result = run_eaid("report", tmp_path / "old.json", "-o", tmp_path / "report")
    assert result.code == 3 and "is an eaid/fit/1 file; make it again" in result.err


def test_the_joint_estimate_stands_beside_the_one_that_is_taken():
    steps = eaid.synth(levels=(20.0, 40.0, 60.0, 80.0, 100.0), repeats=2, rate_hz=50.0, seed=3)
    joint, auto = (eaid.fit(steps, eaid.FitOptions(estimator=name, ci="none")) for name in ("joint", "auto"))
    assert (joint.nonlinear.estimator, auto.nonlinear.estimator) == ("joint", "levels-first")
    assert auto.plant.tau1 == auto.nonlinear.tau1 != joint.nonlinear.tau1 == joint.plant.tau1
    assert auto.nonlinear.joint.tau1 == joint.nonlinear.tau1


def test_results_are_saved_loaded_and_pickled(small_steps, small_fit, small_gains, tmp_path):
    replay = eaid.simulate(small_fit, small_gains, "multisine", duration=3.0)
    walls = eaid.couple(small_fit, small_gains, replay=False, torque=(1.0,))
    for result, name in ((small_fit, "fit.json"), (small_gains, "gains.json"), (walls, "couple.json")):
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
    for result in (replay, small_steps):
        assert pickle.loads(pickle.dumps(result)).to_frame().equals(result.to_frame())


def test_a_sentence_may_be_reworded_without_any_number_changing(
    small_steps, small_fit, small_gains, monkeypatch, tmp_path, capfd
):
    """All sentences replaced by their codes: the same numbers, findings and gains; nothing is printed."""
    for code, row in list(SENTENCES.items()):
        monkeypatch.setitem(SENTENCES, code, type(row)(row.severity, code, row.size))
    again = eaid.fit(small_steps)
    assert again == small_fit and eaid.tune_rc(again) == small_gains and capfd.readouterr() == ("", "")
    again.save(tmp_path / "fit.json")
    texts = [one["text"] for one in json.loads((tmp_path / "fit.json").read_text(encoding="utf-8"))["findings"]]
    assert texts and all(text.split(" (and ")[0] in SENTENCES for text in texts)


def test_steps_that_ask_for_a_dead_time_have_a_plant_with_it():
    t, random, logs = np.arange(0.0, 20.0, 0.02), np.random.default_rng(1), {}
    for u in LEVELS:
        y = -0.03 * u * np.expm1(-np.maximum(t - 5.5, 0) / 0.4) + 0.003 * random.normal(size=t.size)
        logs[f"u{u}"] = pd.DataFrame({"time_s": t, "duty_pct": np.where(t >= 5, u, 0.0), "torque_nm": y})
    fit = eaid.fit(logs, ci="none")
    assert [step.dead_time_s for step in fit.steps] == pytest.approx([0.5] * 3, abs=0.03)
    assert fit.verdict.usable and fit.plant.kind == "lag"
    assert (fit.plant.dead_time_s, fit.plant.tau1[0]) == (pytest.approx(0.5, abs=0.01), pytest.approx(0.4, rel=0.03))
    assert fit.predict(100.0, [0.45, 10.0]).to_numpy().ravel() == pytest.approx([0.0, 3.0], abs=0.02)
    assert "plant  one lag with a dead time" in fit.summary()


def fit_rig(folder):
    return eaid.fit(folder, ci="robust")


@pytest.mark.slow
def test_two_workers_write_the_same_bytes_as_a_loop(tmp_path):
    """docs/how-to/many-rigs.md: a folder of rigs by an engine, the same bytes as one by one."""
    distributed = pytest.importorskip("dask.distributed")
    folders = [tmp_path / f"rig-{seed}" for seed in range(4)]
    for seed, folder in enumerate(folders):
        folder.mkdir()
        eaid.synth(levels=tuple(LEVELS), repeats=2, rate_hz=50.0, seed=seed).save(folder / "data.h5")
        fit_rig(folder).save(folder / "loop.json")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, processes=True) as cluster,
        distributed.Client(cluster) as client,
    ):
        fits = client.gather(client.map(fit_rig, folders))
    for folder, fit in zip(folders, fits, strict=True):
        fit.save(folder / "dask.json")
        assert (folder / "dask.json").read_bytes() == (folder / "loop.json").read_bytes()
    assert len({(folder / "loop.json").read_bytes() for folder in folders}) == 4
