"""`fit.plot()` and `run.plot()` on axes of the caller's own, or on new ones."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from eaid.report.plots import plot_fit, plot_replay
from eaid.report.results import read_results


def test_a_fit_has_a_line_a_level(files: dict[str, Path]):
    fit = read_results([files["clutch.json"]]).fits[0].result
    ax = Figure().subplots()
    assert plot_fit(fit, ax) is ax and ax.get_ylabel() == "Torque (N·m)"
    assert [line.get_label() for line in ax.lines] == [f"{u:g} %" for u in fit.data.levels]
    top = fit.nonlinear.curves[-1]
    assert ax.lines[-1].get_ydata()[-1] == pytest.approx(top.Ts, rel=0.05)


def test_a_replay_and_its_reference(files: dict[str, Path]):
    replay = read_results([files["steps.h5"]]).replays[0].result
    ax = plot_replay(replay)
    assert [line.get_label() for line in ax.lines] == ["reference", "RC", "PI"]
    assert np.max(ax.lines[0].get_ydata()) == pytest.approx(np.max(replay.records["rc"].columns["reference_nm"]))
