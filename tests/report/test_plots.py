"""`fit.plot()` and `run.plot()` on axes of the caller's own, or on new ones."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from eaid.report.plots import plot_fit, plot_replay
from eaid.report.results import read_results


def test_a_fit_over_its_data_or_over_the_level(files: dict[str, Path]):
    results = read_results([files["clutch.json"], files["clutch.h5"]])
    fit, data = results.fits[0].result, results.data[0].result
    ax = Figure().subplots()
    assert plot_fit(fit, ax, value="tau1") is ax
    model, points = ax.lines[-1], ax.containers[0].lines[0]
    assert ax.get_xlabel() == "Duty (%)" and ax.get_ylabel() == "Fast constant $\\tau_1$ (s)"
    assert points.get_ydata() == pytest.approx([row.tau1 for row in fit.friction.levels])
    assert model.get_xdata()[[0, -1]] == pytest.approx(fit.nonlinear.u_range)
    over = plot_fit(fit, data=data)
    assert len([line for line in over.lines if len(line.get_xdata())]) == 2 * len(data.levels)


def test_a_replay_and_its_reference(files: dict[str, Path]):
    replay = read_results([files["steps.h5"]]).replays[0].result
    ax = plot_replay(replay)
    assert [line.get_label() for line in ax.lines] == ["reference", "RC", "PI"]
    assert np.max(ax.lines[0].get_ydata()) == pytest.approx(np.max(replay.traces["rc"]["reference_nm"]))
