"""References, what is measured on each, what a replay takes and refuses, and what it says of itself."""

import numpy as np
import pytest

import eaid
from eaid.replay import metrics

DT = 1e-3
T = np.linspace(0.0, 2.0, 201)
OPEN = {"controller": ("open-loop",)}


def reference_of(run, name="open-loop"):
    return run.records[name].columns["reference_nm"]


def test_the_multisine_is_that_of_specification_6(fit, gains):
    run = eaid.simulate(fit, gains)
    t, made = np.arange(12_000) * DT, reference_of(run, "rc")
    waves = zip((0.2, 0.5, 1, 2, 4), (0, 1, 4, 9, 16), strict=True)
    np.testing.assert_allclose(made, 2 + sum(0.2 * np.sin(2 * np.pi * f * t + 1.7 * k) for f, k in waves), atol=1e-11)
    assert (run.head.scenario, run.head.dt_s, run.head.counted_from_s) == ("multisine", DT, 5.0)
    assert set(run.records) == {"rc", "pi"}
    error = {name: one.metrics.max_abs_error_nm for name, one in run.records.items()}
    assert error == {"rc": pytest.approx(0.116, abs=5e-4), "pi": pytest.approx(0.797, abs=5e-4)}
    noisy = eaid.simulate(fit, gains, noise_nm=0.01, seed=1).records
    assert noisy["rc"].metrics.max_abs_error_nm == pytest.approx(0.13, rel=0.15)
    for name, one in run.records.items():  # the gains say the same of themselves
        columns, told = one.columns, getattr(gains.replayed, name)
        error, duty = (columns["reference_nm"] - columns["torque_nm"])[5000:], columns["duty_pct"][5000:]
        wanted = {
            "max_abs_error_nm": np.abs(error).max(), "rms_error_nm": np.sqrt(np.mean(error**2)),
            "mean_abs_error_nm": np.abs(error).mean(),
            "mean_abs_duty_step_pct": np.abs(np.diff(duty)).mean(),
            "saturated_fraction": np.mean((duty <= 0) | (duty >= 100)),
        }  # fmt: skip
        for key, value in wanted.items():
            assert getattr(one.metrics, key) == pytest.approx(value, rel=1e-9) == getattr(told, key)
    assert gains.replayed.slope_nm_s == pytest.approx(np.abs(np.gradient(made, DT)).max())
    assert gains.replayed.reference == "multisine" and gains.replayed.counted_from_s == 5.0
    for length, counted in ((4.0, 0.0), (5.0, 0.0), (5.5, 5.0)):  # one that ends before it has settled counts whole
        assert eaid.simulate(fit, gains, duration=length, **OPEN).head.counted_from_s == counted


def test_steps_go_up_and_down_and_each_is_measured_until_the_next(fit, gains):
    run = eaid.simulate(fit, gains, "steps", rate_hz=100.0, **OPEN)
    made = reference_of(run)
    np.testing.assert_array_equal(made, np.repeat([0.0, 1, 2, 3, 4, 3, 2, 1, 0], 500))
    run = eaid.simulate(fit, gains, "steps", duration=9.0)
    for one in run.records.values():
        torque, wanted = one.columns["torque_nm"], one.columns["reference_nm"]
        assert [(step.from_nm, step.to_nm) for step in one.metrics.steps] == [
            (0, 1), (1, 2), (2, 3), (3, 4), (4, 3), (3, 2), (2, 1), (1, 0),
        ]  # fmt: skip
        for k, step in enumerate(one.metrics.steps, 1):
            assert step == metrics.step(torque[1000 * k : 1000 * (k + 1)], wanted[1000 * k - 1], wanted[1000 * k], DT)


def test_the_sweep_is_measured_over_whole_periods(fit, gains):
    """10 s to settle and 5 s that count, in whole periods, two at least; each tone from its phase 0."""
    run = eaid.simulate(fit, gains, "sweep", rate_hz=200.0)
    assert set(run.records) == {"rc", "pi", "open-loop"}
    begin, dt = 0, 1 / 200
    for k, f in enumerate((0.2, 0.3, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0, 2.5, 3.0)):
        before, periods = int(np.ceil(10 * f - 1e-9)), max(2, int(np.ceil(5 * f - 1e-9)))
        a, end = (begin + round(n / f / dt) for n in (before, before + periods))
        for one in run.records.values():
            wanted, torque = one.columns["reference_nm"], one.columns["torque_nm"]
            wave = 2 + np.sin(2 * np.pi * f * np.arange(end - begin) * dt)
            np.testing.assert_allclose(wanted[begin:end], wave, atol=1e-9)
            assert one.metrics.frequencies[k] == metrics.tone(wanted[a:end], torque[a:end], f, dt)
        if k == 0:
            assert run.head.counted_from_s == a * dt == 10.0
        begin = end
    assert len(wanted) == begin
    with pytest.raises(eaid.UsageError, match="leave duration= out"):
        eaid.simulate(fit, gains, "sweep", duration=5.0)
    with pytest.raises(eaid.UsageError, match=r"up to a quarter of the control rate, 2.5 Hz"):
        eaid.simulate(fit, gains, "sweep", rate_hz=10.0)


@pytest.mark.slow
def test_the_gains_of_specification_6_over_frequency(fit, gains):
    records = eaid.simulate(fit, gains, "sweep").records
    gain = {
        name: {tone.frequency_hz: tone.gain_db for tone in one.metrics.frequencies} for name, one in records.items()
    }
    assert all(abs(gain["rc"][f]) <= 0.105 for f in (0.2, 0.3, 0.4, 0.6, 0.8, 1.0))
    assert gain["rc"][1.5] == pytest.approx(-0.9, abs=0.05) and gain["rc"][3.0] == pytest.approx(-6, abs=0.1)
    assert gain["pi"][0.6] == pytest.approx(2.1, abs=0.1) and gain["pi"][3.0] == pytest.approx(-17, abs=0.5)
    assert gain["open-loop"][0.2] == pytest.approx(-4.4, abs=0.1)
    assert gain["open-loop"][3.0] == pytest.approx(-24, abs=0.5)


def test_a_file_lies_on_the_control_grid_from_its_first_instant(fit, gains, tmp_path):
    file = tmp_path / "r.csv"
    file.write_text("note, time_s ,reference_nm\na,1.0,0\nb,2.0,2\n,,\nc,2.59,1\n", encoding="utf-8-sig")
    run = eaid.simulate(fit, gains, reference=file, rate_hz=4.0, **OPEN)
    np.testing.assert_allclose(reference_of(run), [0.0, 0.5, 1.0, 1.5, 2.0, 2 - 0.25 / 0.59, 2 - 0.5 / 0.59])
    assert run.head.scenario == "reference" and run.head.counted_from_s == 0.0
    found = eaid.tune_rc(fit, reference=file, rate_hz=500.0)
    assert found.replayed.reference == str(file) and found.rc.Q_M == pytest.approx(2.0) == found.replayed.slope_nm_s


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time_s,torque\n0,1\n", "its header is not time_s,reference_nm, but time_s,torque"),
        ("", "its header is not time_s,reference_nm, but empty"),
        ("time_s,reference_nm\n0,1\n1,x\n", "row 3 holds '1,x', not 2 finite numbers"),
        ("time_s,reference_nm\n0,1\n1\n", "row 3 holds '1', not 2 finite numbers"),
        ("time_s,reference_nm\n0,1\n\n1,inf\n2,x\n", "row 4 holds '1,inf', not 2 finite numbers"),
        ("time_s,reference_nm\n0,1\n\n1,2\n\n1,3\n", r"time does not rise at row 6 \(1 s after 1 s\)"),
        ("time_s,reference_nm\n\n0,1\n", r"holds 1 row\(s\)"),
        ("time_s,reference_nm\n0,1\n1e-4,2\n", "lasts 0.0001 s, less than one control interval"),
        (b"\xff\xfe\x00\x81", "is no text"),
        (None, "no such file"),
    ],
)
def test_bad_files_are_refused(fit, gains, tmp_path, text, said):
    path = tmp_path / "r.csv"
    if text is not None:
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(eaid.DataError, match=said):
        eaid.simulate(fit, gains, reference=path)


def test_lengths_that_no_replay_takes_are_refused(fit, gains, tmp_path):
    for options, said in (
        ({"duration": 1e-4}, "holds fewer than two control samples"),
        ({"duration": 1e5}, "holds 100,000,000 control samples of 0.001 s, and a replay takes 20,000,000"),
    ):
        with pytest.raises(eaid.UsageError, match=said):
            eaid.simulate(fit, gains, **options)
    (tmp_path / "long.csv").write_text("time_s,reference_nm\n10000,0\n100000,0\n")
    with pytest.raises(eaid.UsageError, match=r"lasts 90000 s, which is 90,000,001 control samples of 0.001 s"):
        eaid.simulate(fit, gains, reference=tmp_path / "long.csv")


def test_what_is_replayed_without_gains_and_without_a_linear_model(played, fit_of, codes, gains):
    run = played(T, gains=None)
    assert set(run.records) == {"open-loop", "inverse"} and "no-gains" in codes(run)
    bare = fit_of(linear=None)
    assert set(played(T, fit=bare, gains=None).records) == {"inverse"}
    with pytest.raises(eaid.UsageError, match="controller open-loop needs a linear model"):
        played(T, fit=bare, gains=None, **OPEN)
    with pytest.raises(eaid.UsageError, match="controller pi needs gains"):
        played(T, gains=None, controller=("pi",))
    with pytest.raises(eaid.DataError, match="holds no nonlinear model, which the replay's plant is"):
        played(T, fit=fit_of(nonlinear=None))


@pytest.mark.parametrize(
    ("data", "dt_s"),
    [
        ({"input_unit": "V", "levels": [30.0, 300.0], "sample_rate_hz": 250.0}, 1e-3),
        ({"output_unit": "N", "levels": [50.0], "sample_rate_hz": 250.0}, 1e-3),
        ({"apparatus": {"sample_rate_hz": 500.0}}, 2e-3),
    ],
)
def test_the_rate_is_the_controllers_and_not_the_loggers(fit_of, data, dt_s):
    run = eaid.simulate(fit_of(data=data), None, controller=("inverse",))
    assert run.head.dt_s == dt_s
    made = eaid.tune_rc(fit_of(data=data), phi=0.05, pi_gains=(1.0, 1.0), rate_hz=400.0)
    assert eaid.simulate(fit_of(data=data), made, controller=("pi",)).head.dt_s == 2.5e-3  # as its gains have it
    assert (run.head.input_unit, run.head.output_unit) == (
        data.get("input_unit", "%"), data.get("output_unit", "N·m"))  # fmt: skip


def test_a_controller_at_a_limit_is_told_but_not_one_at_rest(played, codes, gains):
    """Half above what the plant reaches; half at rest, where 0 is what the reference wants."""
    beyond, resting = np.where(np.arange(len(T)) % 100 < 50, 5.0, 1.0), np.where(T < 1.2, 0.0, 1.0)
    told = codes(played(beyond, 0.05, gains=gains, controller=("pi",)))["controller-at-limit"]
    assert 40 <= told["share_pct"] <= 100
    run = played(resting, 0.05, gains=gains, controller=("pi",))
    assert run.records["pi"].metrics.saturated_fraction > 0.5 and "controller-at-limit" not in codes(run)


def test_what_a_replay_says_of_its_reference(played, codes, fit):
    assert codes(played(5.0 + 0 * T, **OPEN))["reference-above-plant"]["highest"] == pytest.approx(4.372, abs=1e-3)
    assert "reference-above-plant" not in codes(played(4.3 + 0 * T, **OPEN))
    wave = np.abs(np.sin(2 * T))
    tight = eaid.tune_rc(fit, q_max=1.0)
    told = codes(played(wave, 0.01, gains=tight, **OPEN))["reference-above-q-max"]
    assert told["slope"] == pytest.approx(np.abs(np.gradient(wave, 0.01)).max()) and told["Q_M"] == 1.0
    for run in (
        played(wave, 0.01, gains=eaid.tune_rc(fit, q_max=2.5), **OPEN), played(wave, 0.01, gains=None, **OPEN),
        eaid.simulate(fit, tight, "steps", duration=9.0, **OPEN),  # steps have no slope
    ):  # fmt: skip
        assert "reference-above-q-max" not in codes(run)


def test_where_replays_leave_what_was_identified_is_told_in_shares(played, codes):
    def told(reference, name="inverse"):
        run = played(reference, 0.01, controller=(name,))
        return codes(run).get("replay-leaves-identified"), run.records[name].columns

    found, columns = told(np.where(T < 1.0, 2.0, 1.0), "open-loop")
    duty, torque = columns["duty_pct"], columns["torque_nm"]
    assert found["below_pct"] == found["above_pct"] == 0.0 and duty.min() > 10
    assert found["falling_pct"] == pytest.approx(100 * np.mean(np.diff(torque) < 0)) and found["falling_pct"] > 40
    found, columns = told(0.05 + 0 * T)
    duty = columns["duty_pct"]
    assert found["below_pct"] == pytest.approx(100 * np.mean((duty > 0) & (duty < 10))) and found["below_pct"] > 90
    assert found["falling_pct"] < 1.0  # falls below the lowest level have constants of their own
    assert told(2.0 + 0 * T, "open-loop")[0] is None
    for level, duty in ((4.3, 100.0), (0.0, 0.0)):  # at the highest identified duty, and at rest, nothing is left
        found, columns = told(level + 0 * T)
        assert np.mean(columns["duty_pct"] == duty) > 0.3 and found is None


def test_what_a_replay_stands_on_is_said(played, fit_of, fit, codes):
    shaky = fit_of({"solver": {"converged": False}})
    run = played(T, 0.01, fit=shaky, controller=("inverse",))
    assert "replay-not-usable" in codes(run) and set(run.head.not_usable) == {"plant"}
    linear = {"a0": 1.36, "b0": 0.08, "c0": -2.42, "solver": {"converged": False}, "bounds": {"B_m": 12.4, "B_M": 42.6}}
    marked = eaid.tune_rc(fit_of(linear=linear), anyway=True)
    run = played(T, 0.01, gains=marked)
    assert "replay-not-usable" in codes(run) and run.head.not_usable == {"gains": marked.not_usable}
    rise = {"run": "r", "from": 0.0, "level": 9.0, "edge": "up", "start": 0.0, "change": 1.0, "gain": 1.0,
            "shape": "one", "tau1": 1.0, "tau2": None, "C": 1.0, "dead_time_s": 0.02, "rmse": 0.0, "fit_pct": 9.0,
            "R2": 1.0, "samples": 9}  # fmt: skip
    late = fit_of(steps=[rise])
    run = played(T, 0.01, fit=late, controller=("inverse",))
    assert codes(run)["dead-time-replayed"] == {"dead_time_s": 0.02}
    assert not run.records["inverse"].columns["torque_nm"][:3].any()
    run = played(T, 0.01, fit=late, controller=("inverse",), delay_samples=1)
    assert run.head.rig.delay_samples == 1 and "dead-time-replayed" in codes(run)
    assert not (torque := run.records["inverse"].columns["torque_nm"])[:4].any() and torque[4:].any()
    assert "nothing-to-replay-on" not in codes(eaid.tune_rc(fit, reference="multisine"))
    assert "nothing-to-replay-on" in codes(eaid.tune_rc(fit_of(nonlinear=None)))


def test_a_controller_that_cycles_is_told_to_cycle(fit_of, codes):
    """Of one lag without noise the inverse holds its output; on noise it goes from limit to limit, and it was told that
    its errors are the actuator's. Behind a dead time it does so without any, and is refused."""
    lag = {"C": 1.0, "tau1": [2.0, 0, 0], "tau2": [2.0, 0, 0], "Ts": [0.0, 0.05, 0, 0], "u_range": [1.0, 100.0]}
    t = np.arange(0.0, 5.0, 0.01)
    held = (t, np.full(len(t), 2.0))
    fit = fit_of(nonlinear=lag)
    still = eaid.simulate(fit, reference=held, controller=("inverse",))
    assert not {"controller-cycles", "controller-at-limit"} & set(codes(still))
    noisy = codes(eaid.simulate(fit, reference=held, controller=("inverse",), noise_nm=0.05))
    assert noisy["controller-cycles"]["count"] > 100 and noisy["controller-cycles"]["turns"] == 0
