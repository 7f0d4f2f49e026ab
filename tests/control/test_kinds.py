"""The table of controllers: each row runs, is saved and has margins, by its row alone; the PI with feedforward."""

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

import eaid
from eaid.control.gains import law_of
from eaid.control.kinds import LAW_KINDS
from eaid.control.pi_feedforward import pi_feedforward_step
from eaid.control.rc import rc_step
from eaid.options import CONTROLLERS

from ..conftest import loaded

small = st.floats(-3, 3, allow_subnormal=False)


@pytest.fixture(scope="module")
def gains(tuned):
    return tuned(nonlinear=True)


@given(small, small, st.floats(-10, 10), small)
def test_the_pi_with_feedforward_is_rc_without_its_robust_term(gains, integral, reference, rate, torque):
    law, rc = law_of(gains, "pi-feedforward"), law_of(gains, "rc")
    bare = rc._replace(K_D=law.K_P / rc.B_hat, K_P=law.K_I / rc.B_hat, rho_constant=0.0, rho_slope=0.0)
    state, duty = pi_feedforward_step(law, integral, reference, rate, torque, 1e-3)
    same_state, same = rc_step(bare, integral, reference, rate, torque, 1e-3)
    assert state == same_state and duty == pytest.approx(same, rel=1e-12, abs=1e-9)


@pytest.fixture(scope="module")
def late(fit_of, rises):
    """A fit behind a dead time of 0.2 s, for which every row of the table has gains."""
    return fit_of(nonlinear=True, steps=rises(0.2))


@pytest.fixture(scope="module")
def late_gains(late):
    return eaid.tune_rc(late)


@pytest.mark.parametrize("name", LAW_KINDS)
def test_every_row_is_saved_and_replayed_plainly_and_in_machine_code(name, late, late_gains, tmp_path):
    late_gains.save(tmp_path / "gains.json")
    read = eaid.load(tmp_path / "gains.json")
    assert law_of(read, name) == law_of(late_gains, name) and isinstance(law_of(read, name), LAW_KINDS[name].gains)
    assert all(point.loops[name].stable for point in read.margins.points) and name in read.params.index
    assert name in {*read.replayed.rows, "pi-feedforward"} and name in CONTROLLERS
    run = eaid.simulate(late, read, "multisine", controller=(name,), duration=2.0, plants=2)
    alone = run.records[name].metrics
    assert alone.plants.metrics["max_abs_error_nm"].worst.value == pytest.approx(alone.max_abs_error_nm, rel=1e-9)


def test_what_is_compared_is_what_a_replay_has(gains, fit_of):
    run = eaid.simulate(fit_of(nonlinear=True), gains, "multisine", controller=("rc", "pi", "pi-feedforward"))
    rows = gains.replayed.rows
    assert list(rows) == ["rc", "equal_pi_feedforward", "equal_pi", "pi", "paper_pi"]
    for row, name in (("rc", "rc"), ("pi", "pi"), ("equal_pi_feedforward", "pi-feedforward")):
        assert rows[row].max_abs_error_nm == run.records[name].metrics.max_abs_error_nm
    slopes, taken = gains.rc.equal_pi, gains.model.a0 / gains.model.b0  # by the feedforward
    for name, less in (("rc", 0.0), ("equal_pi", taken), ("equal_pi_feedforward", 0.0)):  # of equal margins
        assert slopes.K_P - less == rows[name].K_P and rows[name].K_I == slopes.K_I
        assert rows[name].gain_db == pytest.approx(rows["rc"].gain_db, abs=0.5)
        assert rows[name].phase_deg == pytest.approx(rows["rc"].phase_deg, abs=0.6)
    assert rows["pi"].gain_db > rows["rc"].gain_db + 5
    assert (rows["rc"].gain_db, rows["rc"].phase_deg) == (
        gains.margins.worst["rc"].gain_db, gains.margins.worst["rc"].phase_deg,
    )  # fmt: skip


@pytest.mark.parametrize(("changes", "said"), [({"B_hat": -1.0}, "B_hat is -1"), ({"K_I": None}, "has no K_I")])
def test_gains_that_no_loop_runs_with_are_refused(gains, fit_of, tmp_path, changes, said):
    gains.save(tmp_path / "gains.json")
    plain = json.loads((tmp_path / "gains.json").read_text(encoding="utf-8"))
    held = {**plain["controllers"]["pi-feedforward"], **changes}
    plain["controllers"]["pi-feedforward"] = {key: one for key, one in held.items() if one is not None}
    changed = loaded({key: part for key, part in plain.items() if key != "digest"})
    with pytest.raises(eaid.DataError, match=said):
        eaid.simulate(fit_of(nonlinear=True), changed, "multisine", controller=("pi-feedforward",))
    assert math.isfinite(law_of(changed, "rc").B_hat)
