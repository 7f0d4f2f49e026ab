"""What moved between sessions, whether gains have to be made anew, and whether a recorded loop keeps its promise."""

import msgspec
import numpy as np
import pandas as pd
import pytest
from scipy import signal, stats

import eaid
from eaid.findings import finding
from eaid.sessions.compare import Shift, holm


@pytest.fixture(scope="module")
def before(make):
    return eaid.fit(make(30))


def test_a_gain_that_fell_by_half_is_found_alike_at_all_levels(before, make):
    now = eaid.fit(make(31, np.log(0.5)))
    (shift, *_) = eaid.compare(now, before).shifts
    assert shift.low < 0.5 < shift.high and shift.ratio == pytest.approx(0.5, rel=0.08)
    assert shift.moved and shift.p < 1e-6
    assert eaid.compare(now, before).changed


def test_levels_that_move_apart_are_found_though_their_mean_stays(before, make):
    now = eaid.fit(make(32, 0.12, 0.5))
    found = eaid.compare(now, before)
    shift = found.shifts[0]
    assert not shift.alike and shift.p_alike < 1e-3 and found.changed
    assert "not alike at all levels" in found.summary()
    ratios = [one.ratio for one in shift.levels]
    assert ratios == sorted(ratios) and ratios[0] < 0.8 and ratios[-1] > 1.2


def test_held_output_and_peak_are_claimed_as_t_s_is_and_what_to_do_of_the_gains_is_said(slipping):
    (a, b, *_), gains = slipping[0].values(), slipping[1]
    found = eaid.compare(a, b)
    for name in ("held", "peak"):
        (shift,) = [one for one in found.shifts if one.quantity == name]
        assert shift.moved and shift.ratio == pytest.approx(gains[0] / gains[1], rel=0.05)
        assert sum(f"{name}" in line and line.startswith("moved   A against B") for line in found.lines()) == 1
    assert msgspec.structs.replace(found, shifts=tuple(one for one in found.shifts if one.quantity == "peak")).changed
    assert "retune  likely, as A moved; gains= gains.json" in found.summary()


def moving(seed, levels, gain=0.02, tau=0.3):
    """Random steps of one lag, whose inputs count as moving."""
    rng, dt = np.random.default_rng(seed), 0.02
    u = np.repeat(rng.uniform(*levels, 150), rng.integers(4, 12, 150))
    u[:60] = 0.0
    y = signal.lfilter([0.0, gain * (1 - np.exp(-dt / tau))], [1.0, -np.exp(-dt / tau)], u)
    rows = {"time_s": dt * np.arange(len(u)), "duty_pct": u, "torque_nm": y + 0.005 * rng.standard_normal(len(u))}
    return eaid.fit(pd.DataFrame(rows))


def test_sessions_of_moving_inputs_are_compared_where_both_went():
    """Their curves are shown at inputs of their own, and they "shared no level"."""
    before, now, slow = moving(1, (10, 90)), moving(2, (20, 100), gain=0.014), moving(3, (15, 95), tau=0.42)
    (shift, *_) = eaid.compare(now, before).shifts
    assert shift.quantity == "Ts" and shift.low < 0.7 < shift.high and shift.moved
    assert min(one.level for one in shift.levels) >= 20 and max(one.level for one in shift.levels) <= 90
    found = eaid.compare(slow, before)
    assert not found.changed and found.tune_anew is None and "perhaps, as τ1 moved" in found.retuning
    assert [one.verdict for one in found.shifts] == ["unclear", "moved"] and "unclear A against B" in found.summary()


def test_shift_and_test_of_likeness_are_those_of_scipy(fits):
    """By hand from the two fits' own intervals."""
    a, b = fits["s0"], fits["s1"]
    shift = eaid.compare(a, b).shifts[0]
    rows = list(zip(a.friction.levels, b.friction.levels, strict=True))

    def variance(row):
        return (np.log(row.ci95.Ts[1] / row.ci95.Ts[0]) / 2 / stats.t.ppf(0.975, row.ci95.dof["Ts"])) ** 2

    def common(fit, rows):
        """How T_s of levels go together: as those of one curve do."""
        known, u = fit.nonlinear.covariance, np.array([row.level for row in rows]) / 100
        at = [k for k, name in enumerate(known.order) if name.startswith("Ts")]
        powers = u[:, None] ** np.arange(len(at)) / np.array([[row.Ts] for row in rows])
        of_curve = powers @ np.array(known.matrix)[np.ix_(at, at)] @ powers.T
        sd = np.sqrt([variance(row) for row in rows]) / np.sqrt(np.diag(of_curve))
        return of_curve * np.outer(sd, sd)

    delta = np.array([np.log(x.Ts / y.Ts) for x, y in rows])
    V = np.array([variance(x) + variance(y) for x, y in rows])
    weight = 1 / V / (1 / V).sum()
    mean = float(weight @ delta)
    assert shift.ratio == pytest.approx(np.exp(mean))
    error = np.sqrt(weight @ (common(a, [x for x, _ in rows]) + common(b, [y for _, y in rows])) @ weight)
    assert error > 1.05 / np.sqrt((1 / V).sum())  # what all levels owe to the same τ2
    assert 2 * stats.t.sf(abs(mean) / error, shift.dof) <= shift.p * (1 + 1e-9)
    reach = stats.t.ppf(0.975, shift.dof) * error
    assert (shift.low, shift.high) == pytest.approx((np.exp(mean - reach), np.exp(mean + reach)))
    Q = ((delta - mean) ** 2 / V).sum() / (len(delta) - 1)
    assert shift.p_alike >= stats.f.sf(Q, len(delta) - 1, shift.dof) * (1 - 1e-9)


def test_of_two_sessions_alike_as_many_differ_as_chance_has_it(make):
    """Repeats of each session scatter about a level's own value: these stay put."""
    rng = np.random.default_rng(3)
    both = {}
    for k in (40, 41):
        frames = {}
        for u in (20.0, 60.0, 100.0):
            frames |= make(int(rng.integers(1e6)), levels=(u,))
        both[k] = eaid.fit(frames)
    assert not eaid.compare(both[40], both[41]).shifts[0].moved


def test_a_fit_without_intervals_is_named_for_that(before, make):
    """ "Shares no level, record one", of a fit that holds them all."""
    with pytest.raises(eaid.DataError, match="^session B: no level has a T_s with an interval; fit the logs"):
        eaid.compare(before, eaid.fit(make(33), ci="none"))


def test_holms_probabilities_are_those_of_a_textbook():
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])


def test_gains_are_to_be_made_anew_where_b_leaves_their_range(before, gains, make):
    same = eaid.compare(before_again(before), before, gains=gains).retune
    assert same.needed is False and not same.outside
    little = eaid.compare(with_B(before, 0.99), before, gains=gains).retune
    assert (
        little.needed is False and little.outside and "its interval reaches beyond" in little.words()
    )  # as every session has it
    perhaps = eaid.compare(with_B(before, 0.9), before, gains=gains)
    assert perhaps.retune.needed is None and perhaps.tune_anew is None  # and no command makes them anew
    far = eaid.compare(eaid.fit(make(33, np.log(0.4))), before, gains=gains).retune
    assert far.needed is True and len(far.outside) >= 1
    points = tuple(msgspec.structs.replace(one, duty_pct=one.duty_pct + 7.0) for one in gains.margins.points)
    elsewhere = msgspec.structs.replace(gains, margins=msgspec.structs.replace(gains.margins, points=points))
    asked = eaid.compare(with_B(before, 1.5), before, gains=elsewhere).retune  # once "yes", of B between the levels
    assert asked.needed is None and asked.unseen and asked.words().endswith("where the gains' fit has no level")


def with_B(fit, factor):
    """The same by other logs, every B so many times as large."""
    again, linear = before_again(fit), fit.linear
    ends = ((row, tuple(factor * end for end in row.ci95.B)) for row in linear.per_level)
    rows = tuple(
        msgspec.structs.replace(row, B=factor * row.B, ci95=msgspec.structs.replace(row.ci95, B=both))
        for row, both in ends
    )
    return msgspec.structs.replace(again, linear=msgspec.structs.replace(linear, per_level=rows))


def before_again(fit):
    """The same values by other logs."""
    sources = tuple(msgspec.structs.replace(one, sha256=f"x{one.sha256}") for one in fit.data.sources)
    return msgspec.structs.replace(fit, data=msgspec.structs.replace(fit.data, sources=sources))


def test_a_dead_time_is_another_plant_and_loops_that_lack_margins_on_it_are_made_anew(before, gains, make, tmp_path):
    """60 ms more: RC was unstable at the highest level, and the answer "no: A's B stays within the range"."""
    like = eaid.fit(make(36))
    now = msgspec.structs.replace(like, plant_=msgspec.structs.replace(like.plant_, dead_time_s=0.06))
    found = eaid.compare(now, before, gains=gains)
    assert found.retune.needed and "pi" in found.retune.lacking and "on A's plant the loops lack" in found.summary()
    (told,) = [one for one in found.findings if one.code == "plant-moved"]
    assert told.values["what"] == "dead time" and found.changed and eaid.compare(now, before).tune_anew
    assert "moved   A against B: dead time 0.06 s for 0 s" in found.lines()
    page = eaid.report([found], tmp_path / "page").read_text()  # which told of T_s alone, that is the same
    assert page.count("dead time 0.06 s for 0 s") == 2 and "of no level tells" in page
    turned = eaid.compare(before, now, gains=gains).retune  # made for A, they are held against the other
    assert turned.session == "B" and turned.lacking and "on B's plant the loops lack" in turned.words()
    share = msgspec.structs.replace(like, plant_=msgspec.structs.replace(like.plant_, C=0.7))
    assert [one.values["what"] for one in eaid.compare(share, before).findings if one.code == "plant-moved"] == ["C"]


def test_fits_that_share_no_level_are_refused(before, make):
    with pytest.raises(eaid.DataError, match="session B: shares no level with session A"):
        eaid.compare(eaid.fit(make(34, levels=(30.0, 70.0))), before)
    with pytest.raises(eaid.UsageError, match="one result alone"):
        eaid.compare(before)


@pytest.fixture(scope="module")
def gains(before):
    return eaid.tune_rc(before)


@pytest.fixture(scope="module")
def recorded(before, gains):
    """How the loop that ran is recorded: on the plant of the fit, or one of another size."""

    def recorded(factor=1.0):
        part = msgspec.structs.replace(before.plant_, Ts=tuple(factor * c for c in before.plant_.Ts))
        rig = before if factor == 1 else msgspec.structs.replace(before, plant_=part)
        run = eaid.simulate(rig, gains, "multisine", duration=8.0, controller=("pi",), rate_hz=1000.0).records["pi"]
        columns = {name: run.columns[name] for name in COLUMNS}
        noise = 0.03 * np.random.default_rng(1).standard_normal(len(columns["time_s"]))
        return pd.DataFrame(columns | {"torque_nm": columns["torque_nm"] + noise})

    return recorded


COLUMNS = ("time_s", "duty_pct", "torque_nm", "reference_nm")


@pytest.fixture
def against(before, gains, tmp_path):
    """What is said of a log of the loop."""

    def against(log, fit=before, **options):
        log.to_csv(tmp_path / "loop.csv", index=False)
        return eaid.compare(fit, tmp_path / "loop.csv", gains=gains, **{"controller": "pi", "plants": 10} | options)

    return against


@pytest.mark.parametrize(("factor", "kept"), [(1, True), (0.5, False)])
def test_a_recorded_loop_is_held_against_its_replay(recorded, against, factor, kept):
    found = against(recorded(factor))
    assert found.promise.kept is kept, found.summary()
    assert found.promise.noise == pytest.approx(0.03, rel=0.1)
    rms = found.promise.rows[0]
    assert factor < 1 or rms.recorded == pytest.approx(rms.promised, rel=3e-3)  # with the noise that is read
    assert "better than promised" not in found.summary() and found.promise.others == ()
    assert {one.name for one in found.promise.rows} == {"RMS error", "largest error", "overshoot"}


def test_a_loop_that_is_not_named_is_told_to_be_taken_for_the_first(gains, recorded, against):
    first, *others = gains.controllers_by_name
    found = against(recorded(), controller=None)
    assert found.promise.controller == first and "pi" in found.promise.others == tuple(others)
    assert f"taken for the loop of {first}; if it is of {' or '.join(others)}, say controller=" in found.summary()


def test_a_rig_whose_output_counts_negative_keeps_its_promise(before, recorded, against):
    """Its replay was of the other sign: 1.2 N·m RMS were promised, and any loop was better."""
    turned = recorded()
    turned[["torque_nm", "reference_nm"]] *= -1
    as_fitted = msgspec.structs.replace(before, findings=(*before.findings, finding("signs-turned", "data", runs=3)))
    found = against(turned, as_fitted)
    assert found.promise.kept, found.summary()
    assert found.promise.rows[0].recorded == pytest.approx(found.promise.rows[0].promised, rel=3e-3)


def test_a_log_that_begins_while_its_loop_runs_or_holds_no_reference_is_refused(recorded, against):
    with pytest.raises(eaid.DataError, match="begins under load, .* give the log from where its loop began"):
        against(recorded().iloc[2000:])
    with pytest.raises(eaid.DataError, match="holds no reference beside input and output"):
        against(recorded().drop(columns="reference_nm"))


@pytest.mark.parametrize("every", [20, 100])
def test_steps_of_a_reference_that_is_logged_slowly_stay_steps(before, gains, against, every):
    """Replayed as ramps of a row, or held against errors between the rows, a good loop was worse than promised."""
    t = np.arange(0.0, 12.0, 1e-3)
    wanted = np.select([t < 1, t < 4, t < 8], [0.0, 1.2, 0.5], 1.6)
    run = eaid.simulate(before, gains, reference=(t, wanted), controller=("pi",), rate_hz=1000.0).records["pi"]
    found = against(pd.DataFrame({name: run.columns[name][::every] for name in COLUMNS}))
    for row in found.promise.rows[:2]:
        assert row.recorded == pytest.approx(row.promised, rel=0.02), found.summary()


def test_a_replay_is_kept_by_its_own_record(before, gains, tmp_path):
    """Its errors count from some seconds on, and so do those of the log: the first ones made it MISSED."""
    run = eaid.simulate(before, gains, "multisine", controller=("pi",), rate_hz=200.0)
    run.save(tmp_path / "replay.h5")
    pd.DataFrame({name: run.records["pi"].columns[name] for name in COLUMNS}).to_csv(tmp_path / "loop.csv", index=False)
    assert run.head.counted_from_s > 1
    found = eaid.compare(tmp_path / "replay.h5", tmp_path / "loop.csv")
    assert found.promise.kept, found.summary()
    for row in found.promise.rows:
        assert row.recorded == pytest.approx(row.promised, rel=1e-2, abs=1e-2)
    with pytest.raises(eaid.UsageError, match="give the gains that it ran with"):
        eaid.compare(before, tmp_path / "loop.csv")


def test_a_session_in_another_unit_is_no_mounting(before, make):
    """mN·m called N·m: the next session was foreseen within ×/÷ 144,000, without a word."""
    with pytest.raises(eaid.DataError, match="times that of session A, which no mounting makes of a rig: was one of"):
        eaid.compare(before, eaid.fit(make(37, np.log(1000.0))))


def test_what_was_assumed_of_single_runs_is_told_and_is_not_certain(before, make):
    """Of runs that scatter by 5 % where 3 % are assumed a third of such pairs was called changed."""
    draw, t, both = np.random.default_rng(0), np.arange(2000) * 0.01, []
    rise = np.where(t > 2, 1 - 0.85 * np.exp(-(t - 2) / 0.3) - 0.15 * np.exp(-(t - 2) / 5), 0.0)
    for _ in "AB":
        gains = {u: 0.04 * u * np.exp(0.05 * draw.normal()) for u in (20.0, 60.0, 100.0)}
        both.append(eaid.fit({
            f"{u:g}": pd.DataFrame({
                "time_s": t, "duty_pct": np.where(t > 2, u, 0.0),
                "torque_nm": gain * rise + 0.01 * draw.normal(size=2000),
            }) for u, gain in gains.items()
        }))  # fmt: skip
    found = eaid.compare(*both)
    assert "session-assumes-scatter" in {one.code for one in found.findings}
    assert found.shifts[0].quantity == "Ts" and found.shifts[0].dof < 10


def test_another_kind_of_plant_is_told(before):
    """One session rings, and T_s is the same."""
    part = msgspec.structs.replace(before.plant_, kind="ringing", zeta=0.3)
    other = msgspec.structs.replace(before, plant_=part, data=msgspec.structs.replace(before.data, sources=()))
    assert "kind-moved" in {one.code for one in eaid.compare(other, before).findings}


def test_a_promise_is_of_one_run(before, recorded, against):
    """Runs scatter beside their mean, and so does what a loop on one of them does."""
    log, known = recorded(), before.uncertainty

    def width(scatter):
        noise = msgspec.structs.replace(known.noise, scatter={**known.noise.scatter, "Ts": scatter})
        one = msgspec.structs.replace(before, uncertainty=msgspec.structs.replace(known, noise=noise))
        row = against(log, one, plants=40).promise.rows[0]
        return row.high - row.low

    assert width(0.1) > 2 * width(0.0)


def test_sessions_are_called_as_their_files_and_any_number_is_taken(before, make, tmp_path):
    other = eaid.fit(make(55))
    before.save(tmp_path / "week.json")
    assert list(eaid.compare(other, tmp_path / "week.json").files.values()) == [
        "session A", str(tmp_path / "week.json")
    ]  # fmt: skip
    many = [msgspec.structs.replace(before, data=msgspec.structs.replace(before.data, sources=())) for _ in range(27)]
    assert list(eaid.compare(other, *many).files)[-2:] == ["AA", "AB"]


def test_a_shift_beyond_its_own_interval_that_is_one_of_several_says_so():
    """`same … (+0.4 … +9; p 0.12)` contradicted itself."""
    one = Shift("Ts", "B", 1.047, 1.004, 1.09, 0.12, 0.5)
    assert (
        not one.changed
        and not one.suspect
        and one.verdict == "same"
        and one.words().startswith("T_s +4.7 % (+0.4 … +9.0; p 0.12, being one of several numbers)")
    )


def test_a_number_whose_own_interval_leaves_out_1_is_told_and_no_reason_to_keep_the_gains_unseen(before, make):
    """τ1 that was 8 % apart went unsaid, under «make the gains anew: no sign of it»."""
    found = eaid.compare(eaid.fit(make(55)), before)
    shifts = tuple(
        Shift("tau1", "B", 1.08, 1.01, 1.155, 0.09, 0.8) if one.quantity == "tau1" else msgspec.structs.replace(
            one, low=0.9, high=1.1, p=1.0, ratio=1.0
        ) for one in found.shifts
    )  # fmt: skip
    held = msgspec.structs.replace(found, shifts=shifts, retune=None)
    said = "\n".join(held.lines())
    assert "τ1 +8" in said and "perhaps, as τ1 may have moved" in said
    calm = tuple(one for one in shifts if one.quantity != "tau1")
    assert "perhaps" not in "\n".join(msgspec.structs.replace(held, shifts=calm).lines())
