"""One picture of a result, on matplotlib Axes: for notebooks."""

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

from eaid.report import style
from eaid.report.rig import controller_name, level_text, quantity
from eaid.results import frames
from eaid.results.fit import Fit
from eaid.results.replay import Replay


def plot_fit(fit: Fit, ax: Axes | None = None) -> Axes:
    """The step responses of the first model that was fitted (nonlinear, linear, friction), one line a level."""
    ax = ax if ax is not None else plt.subplots(layout="constrained")[1]
    data = fit.data
    time = np.concatenate([[0.0], np.geomspace(1e-3, 1.0, 200)]) * float(max(data.record_s, default=20.0))
    levels = data.levels or (() if fit.recorded is None else np.linspace(*fit.recorded.u_range, 5).tolist())
    shown = frames.predict(fit, levels, time.tolist())
    for colour, (level, values) in zip(style.level_colours(shown.shape[1]), shown.items(), strict=True):
        ax.plot(time, values, color=colour, label=level_text(float(str(level)), data.input_unit))
    ax.set(xlabel="Time since the step (s)", ylabel=quantity(data.output_unit))
    ax.legend(fontsize="small", ncols=2)
    return ax


def plot_replay(replay: Replay, ax: Axes | None = None) -> Axes:
    """Reference and true output of every controller over time."""
    ax = ax if ax is not None else plt.subplots(layout="constrained")[1]
    for i, (name, record) in enumerate(replay.records.items()):
        columns = record.columns
        if i == 0 and "reference_nm" in columns:
            ax.plot(columns["time_s"], columns["reference_nm"], color=style.GREY, linewidth=2.2, label="reference")
        label = controller_name(name)
        ax.plot(columns["time_s"], columns["torque_nm"], label=label, **style.controller_look(name, i))
    ax.set(xlabel="Time (s)", ylabel=quantity(replay.head.output_unit))
    ax.legend(fontsize="small")
    return ax
