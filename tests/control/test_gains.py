"""Reading gains.json, and Table IV as it follows from its own entries."""

import pytest

from eaid.control.gains import paper_gains, pi_gains, rc_gains
from eaid.errors import DataError
from eaid.results.codec import from_plain
from eaid.results.gains import Gains

GAINS = {
    "schema": "eaid/gains/1",
    "model": {"a0": 1.36, "b0": 0.08, "c0": -2.42},
    "rc": {
        "K_P": 4.5,
        "K_D": 3.0,
        "B_hat": 12.5,
        "rho": {"convention": "paper", "constant": 10.8125, "slope": 6.58595},
        "epsilon": 0.5,
        "gamma": 50.0,
        "Q": [[6.6, 5 / 9], [5 / 9, (5 + 10 / 9) / 6]],
    },
    "pi": {"K_P": 21, "K_I": 360},
}


def changed(*path, value):
    def copy(part, keys):
        if not keys:
            return value
        return {**part, keys[0]: copy(part.get(keys[0], {}), keys[1:])}

    return copy(GAINS, list(path))


def read(plain):
    return from_plain(plain, Gains, "g.json")


def test_paper_gains_are_table_iv():
    rc, pi = paper_gains()
    assert rc.rho_constant == pytest.approx(10.8125, abs=1e-12)
    assert rc.rho_slope == pytest.approx(6.58595, abs=5e-6)
    assert (pi.K_P, pi.K_I) == (21.0, 360.0)


def test_a_file_of_the_contract_alone_reads():
    rc, pi = rc_gains(read(GAINS)), pi_gains(read(GAINS))
    assert rc == pytest.approx(paper_gains()[0], rel=1e-6)
    assert pi == paper_gains()[1]
    assert (rc.duty_min, rc.duty_max, rc.back_calculation) == (0.0, 100.0, 0.0)


def test_limits_and_back_calculation_are_read():
    limited = {**GAINS, "duty_limits_pct": [5, 90]}
    assert rc_gains(read(limited)).duty_max == 90.0 and pi_gains(read(limited)).duty_min == 5.0
    wound = changed("rc", "anti_windup", value={"method": "back-calculation", "gain": 0.003})
    assert rc_gains(read(wound)).back_calculation == 0.003
    held = changed("rc", "anti_windup", value={"method": "conditional", "gain": 0.003})
    assert rc_gains(read(held)).back_calculation == 0.0


@pytest.mark.parametrize(
    ("gains", "words"),
    [
        ({}, "g.json: its content has no model"),
        (changed("rc", value=3), "g.json: its rc is 3"),
        (changed("rc", "K_P", value="4.5"), 'g.json: its rc.K_P is "4.5"'),
        (changed("rc", "epsilon", value=0), "g.json: its rc.epsilon is 0"),
        (changed("model", "b0", value=-0.1), "b0 is -0.1, it has to be positive"),
        (changed("rc", "Q", value=[[1, 2], [2, -1]]), "Q[1][1] is -1, it has to be positive"),
        (changed("model", "b0", value=1e-300), "b0 is 1e-300, which no loop of a rig has"),
        (changed("model", "a0", value=-1e50), "a0 is -1e+50, which no loop of a rig has"),
        (changed("rc", "K_P", value=-1e5), "K_P is -100000, it has to be positive"),
        (changed("rc", "K_D", value=0), "K_D is 0, it has to be positive"),
        (changed("rc", "epsilon", value=1e-300), "epsilon is 1e-300, which no loop of a rig has"),
        (changed("rc", "rho", "slope", value=1e50), "rho.slope is 1e+50, which no loop of a rig has"),
        (changed("pi", "K_I", value=1e50), "pi.K_I is 1e+50, which no loop of a rig has"),
        (changed("rc", "Q", value=[1, 2]), "g.json: its rc.Q[0] is 1"),
        ({**GAINS, "duty_limits_pct": [90, 5]}, "duty_limits_pct 90 to 5"),
        ({**GAINS, "duty_limits_pct": [-1, 5]}, "duty_limits_pct -1 to 5"),
        ({**GAINS, "duty_limits_pct": 90}, "duty_limits_pct is 90"),
    ],
)
def test_a_bad_file_gets_its_sentence(gains, words):
    with pytest.raises(DataError) as refusal:
        rc_gains(read(gains)), pi_gains(read(gains))
    assert words in str(refusal.value)


def test_a_controller_that_was_not_designed_is_absent():
    alone = read({"model": GAINS["model"]})
    assert rc_gains(alone) is None and pi_gains(alone) is None
    assert read(changed("rc", "rho", value=None)).rc is None
