"""The two pictures of the first screen: the model against its data, and the controllers or the fitted values."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from eaid.report import style
from eaid.report.draw import marked, pngs_of, source_of
from eaid.report.figures import values
from eaid.report.figures.recorded import drawn_logs, log_panels
from eaid.report.figures.replays import counted_from, traces_of, tracking_panels, units_of
from eaid.report.figures.steps import draw_level_steps, draw_steps, nonlinear_curves, paired, single_curves, some_levels
from eaid.report.live import Panel, draw_panels
from eaid.report.results import NEEDED, Results
from eaid.results.replay import Replay
from eaid.results.summary import believed_levels

SCENARIOS = ("multisine", "reference", "steps")
"""Replays that are shown, the best first."""
WIDTH_IN, HEIGHT_IN = 5.0, 2.75
SHOWN_S = 20.0
"""Most of a replay that is shown [s]."""


@dataclass(frozen=True)
class Picture:
    """A picture of the first screen."""

    title: str
    part: str
    """Where on the page more of it stands."""
    src: str
    size_px: tuple[int, int]


def summary_pictures(results: Results, mark: str | None = None) -> list[Picture]:
    """The first two candidates."""
    pictures = []
    with style.look():
        for title, part, figure in islice(_candidates(results), 2):
            if mark is not None:
                marked(figure, mark)
            size = figure.get_size_inches()
            (png,) = pngs_of(figure, 200)
            pictures.append(Picture(title, part, source_of(png), (round(96 * size[0]), round(96 * size[1]))))
    return pictures


def _candidates(results: Results) -> Iterator[tuple[str, str, Figure]]:
    """Title, part of the page and picture, drawn when it is wanted, the best first.

    The model on its data, controllers, fitted values over the level, or a step with the curve that it asks for.
    """
    data, fit = results.main_data, results.main_fit
    logs = drawn_logs(fit.recorded.logs) if fit is not None and fit.recorded is not None else []
    if fit is not None and logs:  # the input, and below it the output and the model driven by that input alone
        figure, axes = style.sheet(WIDTH_IN, HEIGHT_IN, 2, 1, sharex=True, height_ratios=(1, 2))
        units = fit.data.input_unit, fit.data.output_unit
        _untitled(axes, log_panels(logs[-1].curve, units)[:2], "Time of the log (s)")
        style.legend_over(figure, axes[1])
        yield "Measured against model", "model", figure
    elif data is not None:
        models = nonlinear_curves(fit, data) or single_curves(fit)
        figure, (one,) = style.sheet(WIDTH_IN, HEIGHT_IN)
        draw_steps(one, replace(data, levels=tuple(some_levels(data.levels, 6))), models)
        said, part = ("Measured against model", "model") if models else ("Measured", "data")
        yield said, part, figure
    replay = next(filter(None, map(results.replay, SCENARIOS)), None)
    if replay is not None:
        yield "Controllers against the reference", "replay", _controllers(replay)
    if fit is None:
        return
    if len(believed_levels(fit)) > 1:
        figure, axes = style.sheet(WIDTH_IN, HEIGHT_IN, 1, 3)
        values.draw_values(axes, fit)
        for name, panel in zip(values.NAMES, axes, strict=True):
            panel.set_title(values.axis_label(name, fit.data.output_unit))
        yield "Fitted values over the level", "model", figure
    for recorded in (given.result for given in results.data):
        if recorded.kind == fit.data.kind and paired(recorded, fit.steps):
            figure, (one,) = style.sheet(WIDTH_IN, HEIGHT_IN)
            draw_level_steps(one, recorded, fit.steps)
            yield "Steps, each by its own curve", "model", figure


def _untitled(axes: Sequence[Axes], shown: Sequence[Panel], time: str = "Time (s)") -> None:
    draw_panels(axes, shown, time)
    for one in axes:
        one.set_title("")


def _controllers(replay: Replay) -> Figure:
    """(top) reference and the output under each controller, (bottom) the error, where it counts."""
    figure, axes = style.sheet(WIDTH_IN, HEIGHT_IN, 2, 1, sharex=True, height_ratios=(1.6, 1))
    from_s = counted_from(replay)
    shown = {}
    for name, trace in traces_of(replay).items():
        inside = (trace["time_s"] >= from_s) & (trace["time_s"] <= from_s + SHOWN_S)
        shown[name] = {key: trace[key][inside] for key in NEEDED}
    output, error = tracking_panels(shown, units_of(replay), with_error=True)[:2]
    _untitled(axes, [output, error])
    top = max((float(np.max(np.abs(line.y))) for line in error.lines if len(line.y)), default=1e-9)
    axes[1].set_ylim(-1.1 * top, 1.1 * top)
    style.legend_above(axes[0])
    return figure
