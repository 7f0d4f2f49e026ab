"""A fit of today: by reference steps, with the intervals of the next session, taken by every later command."""

from dataclasses import replace as changed

import msgspec
import numpy as np
import pandas as pd
import pytest

import eaid
from eaid.estimate.draw import draw
from eaid.plant.dynamics import REFERENCE_PLANT

from ..conftest import codes


@pytest.fixture(scope="module")
def step(make):
    return eaid.read(make(70, 0.4, -0.2, levels=(60.0,), repeats=1))


@pytest.fixture(scope="module")
def today(rig, step):
    return eaid.today(rig, step)


def test_its_levels_are_what_the_rig_foresees_given_the_step(rig, step, today):
    shown, plant = eaid.fit(step, model=("friction",)).friction.levels[0], rig.base.plant
    ahead = (1 - plant.C) * np.exp(-step.levels[0].time_s[-1] / plant.time_constants(60.0)[1])
    sd_log = np.hypot(rig.quantities["Ts"].sd_step, 0.5 * ahead)  # half of what was still to come
    steps = pd.DataFrame({"level": [60.0], "value": [shown.Ts], "sd_log": [sd_log]})
    foreseen = rig.next(steps=steps)
    held = {row.level: (row.Ts, *row.ci95.Ts) for row in today.friction.levels}
    for level, row in foreseen.iterrows():
        np.testing.assert_allclose(held[level], row[["value", "low", "high"]], rtol=1e-6)
    assert held[60.0][2] / held[60.0][0] < 1.3 < rig.main.factor


def test_what_is_to_be_held_is_foreseen_and_nothing_of_another_session_is_told_as_todays(rig, step, today):
    (shown,) = eaid.fit(step).responses
    foreseen = rig.next(steps=pd.DataFrame({"level": [60.0], "value": [shown.held]}), quantity="held")
    for row in today.responses:
        held = row.held, *row.ci95.held
        np.testing.assert_allclose(held, foreseen.loc[row.level, ["value", "low", "high"]].astype(float), rtol=1e-6)
        assert row.runs == 0 and row.engaged_s is row.released_s is None
    assert [one.run for one in today.data.replayed] == [one.name for one in step.logs]


@pytest.mark.parametrize(
    ("broken", "said"),
    [
        (lambda q: {name: one for name, one in q.items() if name != "Ts"}, "holds no T_s"),
        (lambda q: q | {"tau2": msgspec.structs.replace(
            q["tau2"], values=(msgspec.structs.replace(q["tau2"].values[0], session="s9"), *q["tau2"].values[1:])
        )}, "is of s9, which is none"),
    ],
)  # fmt: skip
def test_a_rig_that_was_cut_is_refused(rig, step, broken, said):
    with pytest.raises(eaid.DataError, match=said):
        eaid.today(msgspec.structs.replace(rig, quantities=broken(rig.quantities)), step)


def test_what_is_foreseen_is_not_compared_as_if_it_had_been_seen(today, fits):
    found = {one.quantity: one for one in eaid.compare(today, fits["s0"]).shifts}
    shift, held = found["Ts"], found["held"]
    assert held.low < held.ratio < held.high and held.ratio == pytest.approx(shift.ratio, rel=0.1)
    assert [one.level for one in shift.levels] == [60.0] and shift.p_alike is None
    assert shift.dof < 1e3 and "seen at 60 only" in shift.words()


@pytest.mark.slow
def test_where_levels_and_sessions_are_confounded_a_step_tells_of_its_own_levels_only(make):
    rng, fits = np.random.default_rng(5), {}
    for k in range(6):
        levels = (20.0, 40.0, 60.0) if k % 2 else (80.0, 90.0, 100.0)
        fits[f"s{k}"] = eaid.fit(make(80 + k, *rng.normal(0, (0.3, 0.1)), levels=levels))
    rig = eaid.sessions(fits)
    today = eaid.today(rig, eaid.read(make(99, 0.5, 0.0, levels=(40.0,), repeats=1)))
    assert [row.level for row in today.level_values] == [20.0, 40.0, 60.0] and today.verdict.usable
    assert "levels-and-sessions-confounded" in {one.code for one in today.findings}
    before = rig.next([20.0, 40.0, 60.0])
    for row in today.level_values:
        low, high = row.ci95.Ts
        assert low < np.exp(0.5) * REFERENCE_PLANT.steady(row.level) < high
        assert high / low < 0.8 * before.loc[row.level, "high"] / before.loc[row.level, "low"]
    with pytest.raises(eaid.DataError, match=r"shares a session with those of the rig's plant \(20, 40, 60 %\)"):
        eaid.today(rig, eaid.read(make(99, 0.5, 0.0, levels=(90.0,), repeats=1)))


def test_its_plant_goes_through_its_levels_and_drawn_ones_spread_as_they_do(today):
    levels = np.array([row.level for row in today.friction.levels])
    values = np.array([row.Ts for row in today.friction.levels])
    np.testing.assert_allclose(today.plant.steady(levels), values, rtol=0.1)
    drawn = np.log([one.steady(levels) for one in draw(today, 400, 0).plants])
    low, high = np.log([row.ci95.Ts for row in today.friction.levels]).T
    inside = ((low <= drawn) & (drawn <= high)).mean(axis=0)
    assert (inside > 0.8).all() and (inside < 0.995).all()  # less at the step: tails are those of most levels


def test_b_reaches_over_the_next_session(rig, today, fits):
    ends = np.array([row.ci95.B for row in today.linear.per_level])
    bounds = today.linear.bounds
    assert (bounds.B_m, bounds.B_M) == pytest.approx((ends[:, 0].min(), ends[:, 1].max()))
    row = rig.next(quantity="a0").iloc[0]  # of one level a0 is another number than of all: the step tells nothing of it
    assert (today.linear.a0, *today.linear.ci95.a0) == pytest.approx(tuple(row[["value", "low", "high"]]))
    one = fits["s5"].linear.bounds
    assert bounds.B_M / bounds.B_m > one.B_M / one.B_m


def test_every_later_command_takes_it(today, fits, tmp_path):
    gains = eaid.tune_rc(today)
    mounted, of_one = {"for-this-mounting"}, eaid.tune_rc(fits["s5"])
    assert mounted & codes(of_one).keys() and not mounted & codes(gains).keys()
    how = {"plants": 1, "duration": 5.0}
    assert mounted & codes(eaid.simulate(fits["s5"], of_one, **how)).keys()
    assert not mounted & codes(eaid.simulate(today, gains, **how)).keys()
    walls = {"torque": (1.0,), "loops": ("pi",), "replay": False}
    assert mounted & codes(eaid.couple(fits["s5"], of_one, **walls)).keys()
    assert gains.rc.alpha > of_one.rc.alpha
    alone = msgspec.structs.replace(today, uncertainty=msgspec.structs.replace(today.uncertainty, ci="robust"))
    assert eaid.tune_rc(today, phi="data").rc.phi > 1.1 * eaid.tune_rc(alone, phi="data").rc.phi  # of drawn plants
    assert eaid.simulate(today, gains, plants=10).records["rc"].metrics.plants.count == 10
    walled = eaid.couple(today, gains, **walls)
    assert walled.walls and not mounted & codes(walled).keys()
    assert eaid.export(gains, tmp_path / "rig", fit=today, target="yaml").laws
    assert eaid.report([today, gains], tmp_path / "page", figures="fig07").is_file()
    assert eaid.plan(today, check=False).runs
    today.save(tmp_path / "today.json")
    assert eaid.load(tmp_path / "today.json") == today


def test_two_steps_leave_less_open_than_one(rig, make, today):
    two = eaid.today(rig, eaid.read(make(71, 0.4, -0.2, levels=(20.0, 100.0), repeats=1)))

    def worst(fit):
        return max(np.log(row.ci95.Ts[1] / row.ci95.Ts[0]) for row in fit.friction.levels)

    assert worst(two) < worst(today)


def test_a_step_stands_beside_what_was_foreseen_and_beyond_it_or_the_levels_that_is_said(rig, make, today):
    (seen,) = [one for one in today.findings if one.code == "step-foreseen"]
    assert seen.values["low"] < seen.values["value"] < seen.values["high"] and seen.levels == (60.0,)
    assert seen.values["middle"] == pytest.approx(float(rig.foreseen(np.array([60.0])).value[0]))
    for gain, level, code in ((2.5, 60.0, "step-outside"), (0.0, 12.0, "reference-level-outside")):
        odd = eaid.today(rig, eaid.read(make(72, gain, levels=(level,), repeats=1)))
        assert code in codes(odd)
        assert code != "step-outside" or code in codes(eaid.tune_rc(odd))


def test_a_step_whose_slow_part_is_still_to_come_leaves_more_open(rig, make, today):
    """Of a step of 2 s T_s was as sure as of one of 20 s, and a tenth too small."""
    (frame,) = make(70, 0.4, -0.2, levels=(60.0,), repeats=1).values()
    start = float(frame.time_s[frame.duty_pct > 0].iloc[0])
    short = eaid.today(rig, {"step": frame[frame.time_s < start + 2.0]})

    def half(fit):
        (row,) = [row for row in fit.friction.levels if row.level == 60]
        return np.log(row.ci95.Ts[1] / row.ci95.Ts[0])

    assert half(short) > 1.2 * half(today)
    for row, whole in zip(short.friction.levels, today.friction.levels, strict=True):
        assert row.ci95.Ts[0] < whole.Ts < row.ci95.Ts[1]


def test_a_step_in_another_unit_must_not_be_used_and_ends_with_4(rig, make, run_eaid, tmp_path):
    rig.save(tmp_path / "rig.json")
    (frame,) = make(70, 0.4, -0.2, levels=(60.0,), repeats=1).values()
    output = frame.columns[-1]
    frame.assign(**{output: 1000 * frame[output]}).to_csv(tmp_path / "step.csv", index=False)
    done = run_eaid("today", tmp_path / "rig.json", tmp_path / "step.csv", "-o", tmp_path / "today.json")
    assert done.code == 4
    assert done.out.startswith("NOT USABLE: the torque reaches") and "eaid report" in done.out


def test_the_same_by_a_file_or_a_frame_of_the_step(rig, make, tmp_path):
    ((name, frame),) = make(70, 0.4, -0.2, levels=(60.0,), repeats=1).items()
    frame.to_csv(tmp_path / f"{name}.csv", index=False)
    by_file, by_frame = rig.today(tmp_path / f"{name}.csv"), eaid.today(rig, {name: frame})
    assert by_file.friction == by_frame.friction


def test_a_fit_of_today_is_no_session(fits, today):
    with pytest.raises(eaid.DataError, match="now: is foreseen by reference steps, no session"):
        eaid.sessions({"a": fits["s0"], "b": fits["s1"], "now": today})


def test_steps_of_another_rig_or_of_its_own_sessions_are_refused(rig, step, table, make, tmp_path):
    with pytest.raises(eaid.DataError, match="is a log of session s0 already"):
        eaid.today(rig, eaid.fit(fits_again(make)))
    shown = eaid.fit(step)
    force = msgspec.structs.replace(shown, data=msgspec.structs.replace(shown.data, output_unit="N"))
    with pytest.raises(eaid.DataError, match="^s70_60_0: is not of the same rig as the rig: output unit N·m and N"):
        eaid.today(rig, force)
    with pytest.raises(eaid.DataError, match="of a plain table and holds no plant"):
        eaid.today(eaid.sessions(table), step)
    t = np.arange(4000) * 0.01  # steps from level to level, of which no run from rest tells the file
    u = np.repeat(np.array([0.0, 3.0, 6.0, 2.0, 8.0]), 800)
    path = tmp_path / "stairs.csv"
    rows = np.column_stack([t, u, 0.3 * u + np.random.default_rng(0).normal(0, 0.01, len(t))])
    np.savetxt(path, rows, "%.6g", ",", header="time (s),input (V),output (N)", comments="")
    with pytest.raises(eaid.DataError, match="stairs.csv: is not of the same rig as the rig: input unit % and V"):
        eaid.today(rig, eaid.read(path))


def fits_again(make):
    """The logs of the first session once more."""
    rng = np.random.default_rng(11)
    return make(0, *rng.normal(0, (0.3, 0.3)))


def test_a_lag_or_dead_time_that_the_step_alone_shows_is_told(rig, step):
    """Half as slow again, or 80 ms late: tight intervals about last week's, and margins of 25 dB for a loop without."""
    (one,), late_s = step.levels, 0.08
    row_s = float(one.time_s[1] - one.time_s[0])
    rows = round(late_s / row_s)
    late = np.pad(one.runs, ((0, 0), (rows, 0)), mode="constant")[:, : len(one.time_s)]
    rises = [changed(each, output=np.r_[np.zeros(rows), each.output[:-rows]]) for each in step.level_steps]
    told = eaid.today(rig, changed(step, levels=(changed(one, runs=late),), level_steps=tuple(rises)))
    moved = codes(told)["plant-moved"]
    assert moved.values["what"] == "dead time" and told.dead_time_s == pytest.approx(late_s, abs=0.02)
    slower = changed(one, time_s=1.6 * one.time_s)
    slow = eaid.today(rig, changed(step, levels=(slower,), level_steps=()))
    assert "τ1 at 60" in codes(slow)["plant-moved"].values["what"]
    assert "plant-moved" not in codes(eaid.today(rig, step))


@pytest.mark.slow
def test_a_rig_whose_output_counts_negative_has_a_today(make):
    """Its step was replayed with the other sign, and the fit of today was not usable."""
    logs = [make(k, 0.1 * k, levels=(20.0, 60.0, 100.0), repeats=2) for k in range(3)]
    fits = [eaid.fit({name: log.assign(torque_nm=-log["torque_nm"]) for name, log in one.items()}) for one in logs]
    (step,) = make(70, 0.4, levels=(60.0,), repeats=1).values()
    today = eaid.today(eaid.sessions(fits), step.assign(torque_nm=-step["torque_nm"]))
    assert today.verdict.usable and today.turned and today.data.replayed[0].fit_pct > 80


def test_the_answer_of_a_rig_that_overshoots_says_its_peak(slipping):
    """When it comes no reference step tells: the answer ended in a TypeError, behind a written file."""
    t = np.arange(0.0, 14.0, 0.02)
    since = np.maximum(t - 2, 0)
    y = 3.3 * (1.5 * (1 - np.exp(-since / 0.2)) - 0.6 * (1 - np.exp(-since / 2.0)))
    step = pd.DataFrame({"time_s": t, "duty_pct": np.where(t < 2, 0.0, 60.0), "torque_nm": y})
    found = eaid.today(eaid.sessions(slipping[0]), step)
    assert "peaks at" in found.summary() and found.responses[0].peak_s is None
    gain = found.plant.steady(60.0) / eaid.sessions(slipping[0]).base.plant.steady(60.0)
    assert gain * slipping[1][-1] == pytest.approx(3.3 / 3, rel=0.06)  # by the clutch's own curve it was 8 % more
