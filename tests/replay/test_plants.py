"""Drawn plants: each is the replay of that plant alone, the same on one thread and on many; spread and worst."""

import _thread
import time
from contextlib import contextmanager

import numpy as np
import pytest

import eaid

SD = np.array([0.005, 0.05, 0.01, 0.05, 0.5, 0.1, 0.001, 0.02, 0.05, 0.02])
UNCERTAIN = {"covariance": {"matrix": np.diag(SD**2).tolist()}}
NAMES = ("rc", "pi", "open-loop", "inverse")
EVERYTHING = {"noise_nm": 0.02, "delay_samples": 2, "pwm_hz": 300.0}
REFERENCE = 2 + np.sin(np.arange(1500) * 4e-3) + np.repeat([0.0, -1.5, 0.0], 500)


@pytest.fixture(scope="module")
def uncertain(fit_of):
    """With falls that have constants of their own."""
    return fit_of(UNCERTAIN, release={"tau1": 0.3, "tau2": 4.0})


@pytest.mark.parametrize("rig", [{}, EVERYTHING], ids=["bare", "everything"])
def test_each_plant_is_its_own_replay_in_machine_code_and_in_python(played, uncertain, fit_of, gains, rig):
    run = played(REFERENCE, fit=uncertain, controller=NAMES, plants=4, seed=3, **rig)
    assert (run.head.plants, run.head.plants_from) == (4, "covariance")
    alone = []
    tables = run.records["pi"].tables
    for k in range(4):
        plant = {name: tables[f"plants/parameters/{name}"][k].tolist() for name in ("tau1", "tau2", "Ts")}
        drawn = fit_of(plant, release={"tau1": 0.3, "tau2": 4.0})
        alone.append(played(REFERENCE, fit=drawn, controller=("rc", "pi", "open-loop"), seed=3, **rig))
    for name in ("rc", "pi", "open-loop"):
        tables = run.records[name].tables
        for metric in ("rms_error_nm", "max_abs_error_nm", "mean_abs_duty_step_pct", "saturated_fraction"):
            wanted = [getattr(one.records[name].metrics, metric) for one in alone]
            np.testing.assert_allclose(tables[f"plants/metrics/{metric}"], wanted, rtol=1e-9, atol=1e-12)
        stride = round(tables["plants/band_time_s"][1] / 1e-3)
        torque = np.array([one.records[name].columns["torque_nm"][::stride] for one in alone])
        np.testing.assert_allclose(
            tables["plants/band_nm"][[0, 3, -1]], np.quantile(torque, (0, 0.5, 1), axis=0), atol=1e-9
        )
        assert len(tables["plants/band_time_s"]) <= 1000 and run.head.band_quantiles[3] == 0.5


def test_laws_that_know_the_fitted_plant_are_the_same_in_machine_code(played, fit_of):
    """Without uncertainty every drawn plant is the fitted one: the same numbers as in plain Python."""
    fit = fit_of(release={"tau1": 0.3, "tau2": 4.0})
    run = played(REFERENCE, fit=fit, controller=NAMES, plants=2, **EVERYTHING)
    assert run.head.plants_from == "fitted-plant" and "plants-all-alike" in {one.code for one in run.findings}
    for name in NAMES:
        one = run.records[name]
        for metric, values in one.tables.items():
            if metric.startswith("plants/metrics/"):
                wanted = getattr(one.metrics, metric.rpartition("/")[2])
                np.testing.assert_allclose(values, [wanted] * 2, rtol=1e-9, atol=1e-12)
        assert one.metrics.plants.metrics["rms_error_nm"].sd == 0.0


def test_the_spread_of_each_metric_and_the_worst_plant(fit_of, gains):
    run = eaid.simulate(fit_of(UNCERTAIN), gains, "steps", duration=9.0, plants=40, seed=5, controller=("pi",))
    tables, told = run.records["pi"].tables, run.records["pi"].metrics.plants
    assert told.count == 40 and "steps[1].from_nm" not in told.metrics
    for name, spread in told.metrics.items():
        values = tables[f"plants/metrics/{name}"]
        reached = values[np.isfinite(values)]
        assert spread.never == len(values) - len(reached)
        if not len(reached):
            assert spread.mean is None and spread.worst.value is None
            continue
        told_of = (spread.low, spread.median, spread.high, spread.mean, spread.sd)
        wanted = (
            *np.quantile(reached, (0.025, 0.5, 0.975)),
            reached.mean(),
            reached.std(ddof=1) if len(reached) > 1 else 0,
        )
        assert told_of == pytest.approx(wanted)
        worst = int(np.argmax(np.where(np.isfinite(values), values, np.inf)))  # never is worse than late
        assert spread.worst.plant == worst and spread.worst.value == (
            values[worst] if np.isfinite(values[worst]) else None
        )
        assert spread.worst.Ts == tuple(tables["plants/parameters/Ts"][worst])
    assert any(spread.never for spread in told.metrics.values())
    swept = eaid.simulate(fit_of(UNCERTAIN), gains, "sweep", rate_hz=40.0, plants=9, controller=("open-loop",)).records
    one = swept["open-loop"]
    gain, worst = one.tables["plants/metrics/frequencies[1 Hz].gain_db"], one.metrics.plants.metrics
    assert worst["frequencies[1 Hz].gain_db"].worst.plant == np.abs(gain).argmax()  # farthest from 0 dB
    assert len(gain) == 9 and (gain < 0).all()


def test_one_thread_and_many_give_the_same_bytes(played, uncertain, tmp_path, monkeypatch):
    for threads in (1, 4, 1024):
        monkeypatch.setattr("os.sched_getaffinity", lambda _, threads=threads: range(threads))
        options = {"controller": ("rc",), "plants": 50, "noise_nm": 0.01}
        played(REFERENCE[:300], fit=uncertain, **options).save(tmp_path / f"{threads}.h5")
    first, *others = ((tmp_path / f"{threads}.h5").read_bytes() for threads in (1, 4, 1024))
    assert all(other == first for other in others)


def test_a_plant_that_fails_ends_the_work_of_all_threads_and_is_told(played, uncertain):
    seen = []

    @contextmanager
    def progress(label, total):
        def tick():
            if len(seen) == 4:
                _thread.interrupt_main()
            seen.append("tick")
            time.sleep(0.005)

        seen.append((label, total))
        yield tick

    with pytest.raises(KeyboardInterrupt):
        played(REFERENCE[:10], fit=uncertain, controller=("pi",), plants=125, progress=progress)
    assert seen[0] == ("pi on drawn plants", 125) and 4 <= len(seen) < 120
