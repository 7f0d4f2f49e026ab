"""Sessions that are one recording each, of a rig with one lag: what a single engagement does not show is assumed."""

from typing import Any

import numpy as np
import pandas
import pytest
from scipy.signal import cont2discrete, lfilter

import eaid
from eaid.estimate.draw import draw as draw_plants
from eaid.report.tables.sessions import scatter_table

pytestmark = pytest.mark.slow
T = np.arange(0, 60, 0.01)


LAG = cont2discrete(([1.0], [0.3, 1]), 0.01, method="zoh")[:2]  # τ 0.3 s
RINGS = cont2discrete(([16.0], [1, 2.4, 16.0]), 0.01, method="zoh")[:2]  # ω 4 rad/s, ζ 0.3


def recording(gain: float, seed: int, level: float | None = None, rig: Any = LAG) -> pandas.DataFrame:
    """Random steps in volts, or one step to a level."""
    draw = np.random.default_rng(seed)
    u = draw.choice([50.0, 100.0, 200.0, 300.0], 60)[(T / 1.1).astype(int)] * ((T > 2) & (T < 56))
    u = u if level is None else np.where((T > 2) & (T < 12), level, 0.0)
    y = gain * 0.05 * lfilter(np.ravel(rig[0]), rig[1], u) + 0.02 * draw.standard_normal(len(T))
    return pandas.DataFrame({"time (s)": T, "input (V)": u, "force (N)": y})


@pytest.fixture(scope="module")
def fits() -> dict[float, Any]:
    return {gain: eaid.fit(recording(gain, k), shape="one") for k, gain in enumerate((1.0, 1.04, 0.8, 4.0))}


def test_a_gain_that_one_engagement_may_have_by_chance_has_not_moved(fits: dict[float, Any]) -> None:
    """4 % apart, each known to 0.05 %: "moved, p 0" in five of five."""
    near, far = eaid.compare(fits[1.0], fits[1.04]), eaid.compare(fits[1.0], fits[4.0])
    assert not near.changed and "session-assumes-scatter" in {one.code for one in near.findings}
    assert far.changed and far.shifts[0].ratio == pytest.approx(0.25, rel=0.02)


def test_a_b_without_an_interval_leaves_the_range_of_gains_too(fits: dict[float, Any]) -> None:
    gains = eaid.tune_rc(fits[1.0])
    asked = {gain: eaid.compare(fits[gain], fits[1.0], gains=gains).retune for gain in (1.04, 4.0)}
    assert asked[1.04].needed is False and asked[4.0].needed


def test_today_of_one_lag_has_the_gain_of_its_step(fits: dict[float, Any]) -> None:
    """b0 was that of the last session, and so were the gains."""
    rig = eaid.sessions([fits[gain] for gain in (1.0, 1.04, 0.8)])
    today = eaid.today(rig, eaid.read(recording(0.9, 9, level=200.0)))
    assert today.linear.b0 == pytest.approx(0.9 * 0.05 / 0.3, rel=0.05)
    (low, high) = next(row.ci95.B for row in today.linear.per_level if row.level == 200)
    assert low < 0.3 / (0.9 * 0.05) < high


@pytest.mark.slow
def test_today_of_a_rig_that_rings_has_the_gain_of_its_step() -> None:
    """It was refused; and the step's own T_s was that of a clutch, known to 24 % for 9."""
    rig = eaid.sessions([eaid.fit(recording(gain, k, rig=RINGS)) for k, gain in enumerate((1.0, 1.04, 0.8, 1.3))])
    assert rig.gives_today and "reference step" in rig.advice
    today = eaid.today(rig, eaid.read(recording(0.9, 9, level=200.0, rig=RINGS)))
    (value, (low, high)), kept = today.plant_.at(200.0)["Ts"], [one.code for one in today.findings]
    assert today.plant_.kind == "ringing" and low < 9.0 < high and high / value < 1.12
    assert "kept-from-base" not in kept
    for name, true in (("omega", 4.0), ("zeta", 0.3)):
        _, (low_end, high_end) = today.plant_.numbers[name]
        assert 0.99 * low_end < true < 1.01 * high_end
    spread = np.std(np.log([float(one.steady(200.0)) for one in draw_plants(today, 200, 0).plants]))
    assert spread == pytest.approx(np.log(high / low) / 3.92, rel=0.2)
    assert len(eaid.tune_rc(today).params) > 0


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["ringing", "series", "lag"])
def test_today_has_the_pace_of_its_step(kind: str) -> None:
    """It had the lags of the session with most levels, in that session's interval: ω 4.6 (4.57 … 4.64) for 3.5."""

    def rig_of(pace: float) -> Any:
        den = {"ringing": [1, 2.4, 16.0], "series": [0.48, 1.6, 1.0], "lag": [0.5, 1.0]}[kind]
        slower = [one * pace ** (len(den) - 1 - k) for k, one in enumerate(den)]
        return cont2discrete((den[-1:], slower), 0.01, method="zoh")[:2]

    sessions = [eaid.fit(recording(gain, k, rig=rig_of(pace))) for k, (gain, pace) in enumerate(PACES)]
    rig = eaid.sessions(sessions)
    shown = {row[0] for row in scatter_table(rig).rows}
    assert shown >= {"ringing": {"ω", "ζ"}, "series": {"τ1", "τ2"}, "lag": {"τ1"}}[kind]
    today = eaid.today(rig, eaid.read(recording(0.95, 9, level=200.0, rig=rig_of(1.1))))
    true = {"ringing": {"omega": 4 / 1.1}, "series": {"tau1": 0.4 * 1.1, "tau2": 1.2 * 1.1}, "lag": {"tau1": 0.55}}[
        kind
    ]
    for name, wanted in true.items():
        value, (low, high) = today.plant_.numbers[name]
        assert low < wanted < high and value == pytest.approx(wanted, rel=0.05)
    assert today.plant_.at(200.0)["Ts"][0] == pytest.approx(9.5, rel=0.02)
    if kind == "ringing":
        moved = {one.quantity: one for one in eaid.compare(sessions[0], sessions[2]).shifts}["omega"]
        assert moved.low < PACES[2][1] / PACES[0][1] < moved.high and moved.moved


PACES = ((1.0, 1.0), (1.04, 0.9), (0.9, 1.25), (1.1, 1.4))
