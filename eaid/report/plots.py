"""One picture of a result, on matplotlib Axes: for notebooks."""

from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

from eaid.results import frames
from eaid.results.fit import Fit
from eaid.results.replay import Replay


def plot_fit(fit: Fit, ax: Axes | None = None) -> Axes:
    """The step responses of the first model that was fitted (nonlinear, linear, friction), one line a level."""
    ax = _axes(ax)
    data = fit.data
    longest = max(data.record_s, default=20.0)
    time = np.concatenate([[0.0], np.geomspace(1e-3, 1.0, 200)]) * float(longest)
    shown = frames.predict(fit, list(data.levels), time.tolist())
    colours = plt.get_cmap("viridis")(np.linspace(0, 0.9, shown.shape[1]))
    for colour, (level, values) in zip(colours, shown.items(), strict=True):
        ax.plot(time, values, color=colour, label=f"{level:g}")
    ax.set(xlabel="time since the step [s]", ylabel=f"output [{data.output_unit}]")
    ax.legend(title=f"input [{data.input_unit}]", fontsize="small", ncols=2)
    return ax


def plot_replay(replay: Replay, ax: Axes | None = None) -> Axes:
    """Reference and true output of every controller over time."""
    ax = _axes(ax)
    drawn = False
    for name, record in replay.records.items():
        columns = record.columns
        if "reference_nm" in columns and not drawn:
            ax.plot(columns["time_s"], columns["reference_nm"], color="0.4", linestyle="--", label="reference")
            drawn = True
        ax.plot(columns["time_s"], columns["torque_nm"], label=name)
    ax.set(xlabel="time [s]", ylabel=f"output [{replay.head.output_unit}]")
    ax.legend(fontsize="small")
    return ax


def _axes(ax: Any) -> Axes:
    return ax if ax is not None else plt.subplots()[1]
