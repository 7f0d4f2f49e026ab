"""A rig over its sessions: check values, what is refused, what is warned of."""

from dataclasses import replace

import msgspec
import numpy as np
import pandas as pd
import pytest
from scipy.special import stdtrit

import eaid

from ..conftest import codes

STEPS = {"nothing": [], "one": [(200, 0.200)], "two": [(150, 0.080), (200, 0.200)]}


@pytest.mark.parametrize(
    ("known", "expected"),
    [
        ("nothing", (0.8315, 0.3232, 2.1393, 4.0)),
        ("one", (0.6410, 0.3515, 1.1690, 7.22)),
        ("two", (0.6712, 0.3855, 1.1688, 10.74)),
    ],
)
def test_the_next_session_has_the_check_values(table, known, expected):
    rig = eaid.sessions(table, reference_level=200.0, terms=2)
    sd = rig.main.sd
    np.testing.assert_allclose([sd.gain, sd.tilt, sd.level], [0.2352, 0.4367, 0.0986], rtol=1e-3)
    steps = pd.DataFrame(STEPS[known], columns=["level", "value"]).assign(sd_log=0.11) if STEPS[known] else None
    found = rig.next([300.0], steps=steps).loc[300.0]
    np.testing.assert_allclose(found[:3], expected[:3], rtol=1e-3)
    assert found["dof"] == pytest.approx(expected[3], rel=0.01)


def test_a_file_gives_what_the_memory_does(table, tmp_path):
    table.to_csv(tmp_path / "table.csv", index=False)
    rig = eaid.sessions(tmp_path / "table.csv", terms=2)
    rig.save(tmp_path / "rig.json")
    pd.testing.assert_frame_equal(eaid.load(tmp_path / "rig.json").next([150.0, 250.0]), rig.next([150.0, 250.0]))
    assert "×/÷ 2.57" in rig.summary() and "sessions, not repeats" in rig.summary()


def test_a_term_a_level_is_the_mean_of_the_sessions_there(table):
    rig = eaid.sessions(table)
    means = np.log(table["value"]).groupby(table["level"]).mean()
    np.testing.assert_allclose(np.log(rig.next()["value"]), means, atol=1e-9)
    middle = rig.next([np.sqrt(200 * 300)])["value"].iloc[0]
    assert middle == pytest.approx(np.exp((means[200] + means[300]) / 2))


def test_one_level_and_one_step_may_be_given_alone(table):
    rig = eaid.sessions(table)
    assert rig.next(300.0).index.tolist() == [300.0]
    for levels, said in (([0.0], "0: the sessions hold 150 … 300"), (1000, "and tell nothing of"), ("x", "give numb")):
        with pytest.raises(eaid.UsageError, match=f"levels= .*{said}"):
            rig.next(levels)
    with pytest.raises(eaid.UsageError, match="steps=: give a DataFrame"):
        rig.next(steps=6)
    with pytest.raises(eaid.UsageError, match="quantity= tau1: the sessions know value"):
        rig.next(quantity="tau1")


def together(count, rng, tilt=0.46, levels=(100.0, 150.0, 200.0, 250.0, 300.0)):
    """Sessions that lie high rise more steeply: they meet at 100."""
    x = np.log(np.array(levels) / 100)
    rows = [
        (f"day {s}", u, np.exp(y)) for s in range(count)
        for u, y in zip(levels, 2 * x + tilt * rng.standard_normal() * x + 0.08 * rng.standard_normal(5), strict=True)
    ]  # fmt: skip
    return pd.DataFrame(rows, columns=["session", "level", "value"]).assign(sd_log=0.05)


def test_many_sessions_tell_where_gain_and_tilt_are_apart():
    frame = together(9, np.random.default_rng(2))
    by_itself, middle = eaid.sessions(frame), eaid.sessions(frame, reference_level=200.0)
    assert by_itself.main.reference_level < 200 and by_itself.main.with_step < 0.85 * middle.main.with_step
    few = frame[frame["session"] < "day 7"]
    assert eaid.sessions(few).main.reference_level == 200.0


def test_the_level_worth_most_leaves_least_open(table):
    rig, widest = eaid.sessions(table), {}
    for level in (150.0, 200.0, 300.0):
        after = rig.next(steps=pd.DataFrame({"level": [level], "value": [0.3]}))
        widest[level] = (after["high"] / after["value"]).max()
    assert rig.main.best_level == min(widest, key=widest.get)
    assert rig.main.with_step == pytest.approx(min(widest.values()))


def test_fits_hold_together_as_their_values_do(fits, rig):
    assert list(rig.quantities) == ["Ts", "tau1", "tau2", "B", "a0", "held"]
    rows = [
        (name, row.level, row.Ts, np.log(row.ci95.Ts[1] / row.ci95.Ts[0]) / 2)
        for name, fit in fits.items() for row in fit.friction_levels
    ]  # fmt: skip
    frame = pd.DataFrame(rows, columns=["session", "level", "value", "sd_log"])
    dof = [row.ci95.dof["Ts"] for fit in fits.values() for row in fit.friction_levels]
    frame["sd_log"] /= stdtrit(dof, 0.975)
    pd.testing.assert_frame_equal(eaid.sessions(frame).next(), rig.next(), rtol=1e-6)
    assert 0.1 < rig.main.sd.gain < 0.6 and codes(rig).keys() <= {"session-carries-estimate", "trend-over-sessions"}


@pytest.mark.slow
def test_what_single_runs_scatter_about_their_curve_is_no_noise_of_theirs(make):
    """Taken for it, it was found a second time as nothing between sessions: intervals of today held 75 to 88 %."""
    rng = np.random.default_rng(2)
    once = {f"s{k}": eaid.fit(make(80 + k, *rng.normal(0, (0.3, 0.3)), repeats=1)) for k in range(6)}
    main = eaid.sessions(once).main
    assert max(one.sd_log for one in main.values) < 0.02
    assert main.sd.level == pytest.approx(np.hypot(0.05, 0.05), rel=0.4)  # of the level, and of its run
    repeated = eaid.fit(make(90))
    several = eaid.sessions({**once, "s6": repeated}).main.values
    of_runs = repeated.uncertainty.noise.scatter["Ts"]
    assert all(of_runs < one.sd_log < 1.2 * of_runs for one in several if one.session != "s6")


def test_another_rig_is_refused_with_what_differs(fits):
    some = {name: fits[name] for name in ("s0", "s1", "s2")}
    data = fits["s2"].data
    cases = {
        "drive frequency 300 and 1000": msgspec.structs.replace(data, apparatus=replace(data.apparatus, pwm_hz=1000.0)),
        "output unit N·m and N": msgspec.structs.replace(data, output_unit="N"),
        "input unit % and V": msgspec.structs.replace(data, input_unit="V"),
        "speed .v= in the names. none and 0.5": msgspec.structs.replace(
            data, sources=tuple(msgspec.structs.replace(one, run=f"{one.run}_v=0.5") for one in data.sources)
        ),
    }  # fmt: skip
    for said, other in cases.items():
        with pytest.raises(eaid.DataError, match=f"s2: is not of the same rig as s0: {said}"):
            eaid.sessions({**some, "s2": msgspec.structs.replace(fits["s2"], data=other)})


def test_a_log_in_two_sessions_is_refused(fits, make):
    again = eaid.fit(make(0, 0.1))
    with pytest.raises(eaid.DataError, match=r"b: holds .*, which a holds too"):
        eaid.sessions({"a": again, "b": msgspec.structs.replace(again), "c": fits["s1"]})


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t: t.drop(columns="sd_log"), "no column sd_log"),
        (lambda t: t.assign(value=-t["value"]), "row 1 of the table .* above 0"),
        (lambda t: t.assign(level="low"), "row 1 of the table"),
        (lambda t: t[t["session"] < "day 2"], "the table holds 2 sessions"),
    ],
)
def test_a_table_that_is_none_is_refused(table, change, said):
    with pytest.raises(eaid.DataError, match=said):
        eaid.sessions(change(table))


def test_more_terms_than_levels_are_refused(table):
    with pytest.raises(eaid.UsageError, match="terms= 3: the sessions hold 10 values at 2 levels"):
        eaid.sessions(table[table["level"] < 300], terms=3)


def many(gains, levels=(100.0, 200.0, 300.0), scatter=0.02):
    """A table of sessions with these gains."""
    rng = np.random.default_rng(1)
    rows = [
        (f"day {s}", u, np.exp(g + scatter * rng.standard_normal()))
        for s, g in enumerate(gains) for u in levels
    ]  # fmt: skip
    return pd.DataFrame(rows, columns=["session", "level", "value"]).assign(sd_log=0.02)


def test_values_known_for_certain_are_taken(table):
    exact = eaid.sessions(table.assign(sd_log=0.0))
    np.testing.assert_allclose(exact.next(), eaid.sessions(table.assign(sd_log=1e-4)).next(), rtol=1e-3)


def test_few_sessions_and_a_reference_level_beyond_theirs_are_warned_of(table):
    few, beyond = "few-sessions", "reference-level-outside"
    assert not {few, beyond} & codes(eaid.sessions(table, reference_level=200.0)).keys()
    assert few in codes(eaid.sessions(table[table["session"] != "day 4"]))
    assert beyond in codes(eaid.sessions(table, reference_level=400.0))


def test_today_is_offered_where_there_is_a_plant(rig):
    assert rig.gives_today and not msgspec.structs.replace(rig, base=None).gives_today


def test_a_scatter_that_is_not_seen_is_said():
    found = eaid.sessions(many([0.3, -0.3, 0.1, -0.2, 0.2, 0.0]).assign(sd_log=0.05))
    none = [one for one in found.findings if one.code == "no-scatter-in-parts"]
    assert none and "session × level" in none[0].values["components"]


def test_one_session_that_carries_the_estimate_is_named():
    found = eaid.sessions(many([0.02, -0.03, 0.01, 0.0, 1.5, -0.02, 0.03]))
    (one,) = [one for one in found.findings if one.code == "session-carries-estimate"]
    assert one.values["session"] == "day 4" and one.values["factor"] < 1.3 < one.values["whole"]
    assert "session-carries-estimate" not in codes(eaid.sessions(many([0.2, -0.3, 0.1, -0.2, 0.3, 0.0, 0.15])))


def test_wear_is_found_over_the_order_of_the_sessions():
    rng = np.random.default_rng(5)
    falling = -0.1 * np.arange(8) + 0.05 * rng.standard_normal(8)
    (one,) = [one for one in eaid.sessions(many(falling)).findings if one.code == "trend-over-sessions"]
    assert one.values["pct"] == pytest.approx(-9.5, abs=3)
    shuffled = falling[[3, 6, 0, 7, 2, 5, 1, 4]]
    assert "trend-over-sessions" not in codes(eaid.sessions(many(shuffled)))


def test_levels_each_of_a_day_of_their_own_are_said_and_a_step_tells_nothing_of_another_days(table):
    day = table["session"].str[-1].astype(int)
    alone = table[(day % 3) == table["level"].map({150: 0, 200: 1, 300: 2})]
    found, step = eaid.sessions(alone, terms=2), pd.DataFrame({"level": [200.0], "value": [0.3]})
    assert "levels-and-sessions-confounded" in codes(found)
    assert "levels-and-sessions-confounded" not in codes(eaid.sessions(table))
    assert not any("after one" in line or "worth most" in line for line in found.lines())
    before, after = found.next(), found.next(steps=step)
    pd.testing.assert_frame_equal(before.drop(200.0), after.drop(200.0))
    assert after["high"][200.0] < before["high"][200.0]


def test_the_control_chart_holds_every_session_and_the_next(table):
    axes = eaid.sessions(table).plot()
    assert [text.get_text() for text in axes.get_xticklabels()] == [*(f"day {k}" for k in range(5)), "next"]
    assert axes.get_yscale() == "log"
    assert {"×2", "1", "÷2"} <= {text.get_text() for text in axes.get_yticklabels()}


def test_fits_are_taken_one_by_one_as_compare_takes_them(fits, tmp_path):
    first, second, third, *_ = fits.values()
    second.save(tmp_path / "b.json")
    of_list, *others = (eaid.sessions([first, second, third]), eaid.sessions(first, second, third),
                        eaid.sessions(first, tmp_path / "b.json", third))  # fmt: skip
    for rig in others:
        pd.testing.assert_frame_equal(rig.next(), of_list.next())
    with pytest.raises(eaid.DataError, match="1 session: three and more"):
        eaid.sessions(first)
    with pytest.raises(eaid.UsageError, match="session 3: is a int; give what eaid.fit returns"):
        eaid.sessions(first, second, 3)


def test_what_is_no_rig_or_comes_twice_is_named(tmp_path):
    fit = eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1))
    fit.save(tmp_path / "a.json")
    with pytest.raises(eaid.UsageError, match=r"a\.json holds Fit; give what eaid\.sessions returns"):
        eaid.today(str(tmp_path / "a.json"), fit)
    with pytest.raises(eaid.DataError, match=r"a\.json: is given twice"):
        eaid.sessions([tmp_path / "a.json"] * 3)
    with pytest.raises(eaid.UsageError, match="first: is a int"):
        eaid.compare(3, fit)
    (tmp_path / "empty.json").write_text('{"schema": "eaid/rig/1"}')
    with pytest.raises(eaid.DataError, match=r"empty\.json: .*a rig without quantities"):
        eaid.load(tmp_path / "empty.json")


def test_held_and_peak_are_foreseen_as_measured(slipping):
    fits, _ = slipping
    rig = eaid.sessions(fits)
    assert {"held", "peak"} <= rig.quantities.keys()
    for name in ("held", "peak"):
        values = {one.session: one.value for one in rig.quantities[name].values if one.level == 100}
        assert values == {key: getattr(fit.responses[-1], name) for key, fit in fits.items()}
        foreseen = rig.next(quantity=name)
        assert (foreseen["low"] < min(values.values())).iloc[-1] and (foreseen["high"] > max(values.values())).iloc[-1]
    (also,) = [line for line in rig.lines() if line.startswith("also")]
    assert "held ×/÷" in also and "peak ×/÷" in also


def test_values_of_one_session_that_contradict_each_other_are_refused(table):
    """They ended in a singular matrix of numpy's."""
    both = pd.concat([table, table.iloc[[3]].assign(value=1.3 * table.value.iloc[3], sd_log=1e-9)])
    both.loc[both.index[3], "sd_log"] = 1e-9
    with pytest.raises(eaid.DataError, match="give the mean of the two, with an sd_log by how they scatter"):
        eaid.sessions(both, reference_level=200.0)
