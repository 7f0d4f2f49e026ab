"""Warnings about recorded logs that a person who knows the rigs would sign; skipped where the logs are not there."""

from pathlib import Path

import pytest

import eaid

REAL = Path(__file__).parents[2] / "../shared/realdata"
pytestmark = pytest.mark.skipif(not REAL.is_dir(), reason="the recorded logs are not beside this checkout")


@pytest.mark.slow
def test_clutch_of_three_seconds_overshoots_and_hides_tau2() -> None:
    """README of the logs: from 200 V up the force overshoots, and 3 s cannot identify a τ2 of 4 s."""
    logs = sorted((REAL / "ea-clutch").glob("*V=[23]00_*.csv.gz")) + sorted(
        (REAL / "ea-clutch").glob("*V=250_*.csv.gz")
    )
    stepset = eaid.read(
        logs, columns='time=Time,output="Load Cell"', units="time=us,output=N", name_pattern="_V={level}_",
        step_at=2.0, until=5.0, kind="clutch", repair=True,
    )  # fmt: skip
    sure = eaid.fit(stepset, model=("friction", "nonlinear"))
    assert sure.nonlinear is not None and sure.friction is not None
    reasons = [one.values for one in sure.findings if one.code == "parameter-unknown-at-half-the-levels"]
    assert any(one["parameter"] == "tau2" and one["count"] == 3 == one["of"] for one in reasons)
    assert all(row.ci95.tau2 is None and row.ci95.Ts is not None for row in sure.friction.levels)
    assert "output-decays-under-hold" in {one.code for one in sure.findings}


@pytest.mark.slow
def test_seal_friction_shows_a_free_share() -> None:
    """README of the logs: a free C comes out at 0.4 to 0.8 there, not at 0.85; four sweeps know it to ±0.1."""
    stepset = eaid.read([REAL / "friction-steps"], kind="friction-force")
    sure = eaid.fit(stepset, model=("friction",))
    codes = {one.code for one in sure.findings}
    assert "runs-reject-the-share" in codes
    assert "repeats-miss-alike" in codes  # counted from each run's own start, no shape is right
    share = sure.uncertainty.share
    assert share.rejected and 0.45 < share.ci95[0] < share.ci95[1] < 0.85
    assert sure.friction is not None
    assert 5.0 in {
        u
        for one in sure.findings
        if one.code in ("tau2-open", "parameter-open", "tau2-outlasts-record")
        for u in one.levels
    }
