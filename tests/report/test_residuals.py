"""What a model leaves: its correlations by hand, on the page and in a notebook, and of a log that it has not seen."""

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

import eaid
from eaid.results.residuals import CORRELATION_LAGS, correlation_of

from .conftest import call


def test_correlations_by_hand_and_their_bands():
    rng = np.random.default_rng(5)
    n = 4000
    e, u = rng.normal(size=n), np.repeat(rng.normal(size=n // 20), 20)
    found = correlation_of([e], 0.01, u)
    k = round(found.lag_s[3] / 0.01)
    assert found.own[3] == pytest.approx(e[:-k] @ e[k:] / (e @ e), rel=1e-3) and found.lag_s[-1] == n // 10 * 0.01
    assert found.with_input[3] == pytest.approx(np.corrcoef(u[:-k], e[k:])[0, 1], abs=2e-3)
    counts = np.zeros(2)
    for _ in range(60):  # white residuals, and coloured ones beside an input that is held: one in twenty is outside
        white, held = rng.normal(size=n), np.repeat(rng.normal(size=n // 20), 20)
        coloured = lfilter([1], [1, -0.9], rng.normal(size=n))
        counts += correlation_of([white], 0.01).outside()[0], correlation_of([coloured], 0.01, held).outside()[1]
    assert counts / (60 * CORRELATION_LAGS) == pytest.approx(0.05, abs=0.025)
    assert correlation_of([e + 0.3 * np.roll(u, 200)], 0.01, u).outside()[1] > 2  # the input, late, is left in them


def log(path, seed, wn=6.0):
    """A plant that rings under steps of the duty: ÿ = ω² (0.05 u − y) − 2 ζ ω ẏ, at 50 Hz."""
    rng = np.random.default_rng(seed)
    u, dt, zeta = np.repeat(rng.choice([20.0, 40.0, 60.0, 80.0], 15), 60), 0.02, 0.25
    u[:60], x, y = 0.0, np.zeros(2), np.zeros(900)
    for i in range(1, len(u)):
        for _ in range(20):
            x = x + dt / 20 * np.array([x[1], wn**2 * (0.05 * u[i - 1] - x[0]) - 2 * zeta * wn * x[1]])
        y[i] = x[0]
    rows = {"time_s": dt * np.arange(len(u)), "duty_pct": u, "torque_nm": y + 0.01 * rng.normal(size=len(u))}
    pd.DataFrame(rows).to_csv(path, index=False)
    return path


def test_kinds_hold_out_and_another_log_are_on_the_page(tmp_path, report):
    fit, seen, other = tmp_path / "fit.json", tmp_path / "seen.h5", tmp_path / "other.h5"
    own, another, wrong = (log(tmp_path / f"{name}.csv", seed, wn) for name, seed, wn in
                           (("own", 1, 6.0), ("another", 2, 6.0), ("wrong", 3, 4.5)))  # fmt: skip
    assert call("fit", own, "--shape", "one", "-o", fit, "-q") == 0
    for logs, path in (([own], seen), ([another, wrong], other)):
        assert call("simulate", fit, *(word for one in logs for word in ("--log", one)), "-o", path, "-q") == 0
    page = report(fit, other)
    known = eaid.load(fit)
    held = known.recorded.hold_out
    assert page.rows("Held out") == [["the last third", f"{held.fit_pct:.1f}", f"{held.held_pct:.1f}"]]
    assert f"fits {held.fit_pct:.1f} %, {held.held_pct:.1f} % of what was left out" in page.lights[1][1]
    assert "ring" in page.rows("Kinds of lag that were tried")[0][0]
    heads, good, bad = page.tables["Another log, which the model has not seen"]
    assert heads[-2:] == ["lags outside: own past", "lags outside: input"]
    assert float(good[5]) > 98 > float(bad[5]) and max(int(one) for one in good[-2:]) <= 6 < 20 < int(bad[-2])
    assert "Recorded input through the model" in report(fit, seen).tables
    (tmp_path / "tuesday").mkdir()
    another.rename(namesake := tmp_path / "tuesday" / own.name)
    assert call("simulate", fit, "--log", namesake, "-o", other, "-q", "--force") == 0
    assert "Another log, which the model has not seen" in report(fit, other).tables
    axes = known.plot("residuals")
    assert [one.get_xlabel() for one in axes] == ["Time of the log (s)", "Lag (s)", "Duty (%)"]
    assert axes[1].lines[0].get_ydata() == pytest.approx(known.logs[0].correlation.own)


def test_residuals_of_steps_are_those_of_the_fit(files, whole):
    assert "residuals" in whole.captions
    fit = eaid.fit(eaid.load(files["clutch.h5"]))
    axes = fit.plot("residuals")
    drawn = {line.get_label(): line.get_ydata() for line in axes[0].lines}
    assert drawn["60 %"].max() == pytest.approx(float(np.max(fit.residuals[60.0])))
    middle = axes[2].containers[0][0].get_ydata()
    assert middle == pytest.approx(fit.residuals.groupby(level=0).median().to_numpy())
    with pytest.raises(eaid.DataError, match="read from a file"):
        eaid.load(files["clutch.json"]).plot("residuals")
