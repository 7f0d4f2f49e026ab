"""The two pictures of the first screen: the model against its data, and the controllers or the fitted values."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from eaid.report import style
from eaid.report.draw import marked, pngs_of, source_of
from eaid.report.figures import panels, recorded, steps, values
from eaid.report.figures.recorded import drawn_logs, log_panels
from eaid.report.figures.replays import counted_from, traces_of, tracking_panels, units_of
from eaid.report.figures.steps import Model, draw_steps, model_curves, some_levels
from eaid.report.results import NEEDED, Results
from eaid.report.rig import level_values
from eaid.results.fit import Fit
from eaid.results.recorded import LogFit
from eaid.results.replay import Replay
from eaid.steps.stepset import StepSet

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
    """The first two candidates, drawn."""
    candidates = [*_data_and_model(results), *_replays(results), *_values(results)]
    pictures = []
    for title, part, draw in candidates[:2]:
        with style.look():
            figure = draw()
            if mark is not None:
                marked(figure, mark)
            size = figure.get_size_inches()
            (png,) = pngs_of(figure, 200)
            pictures.append(Picture(title, part, source_of(png), (round(96 * size[0]), round(96 * size[1]))))
    return pictures


Candidates = Iterator[tuple[str, str, Callable[[], Figure]]]
"""Title, part of the page, and how it is drawn."""


def _data_and_model(results: Results) -> Candidates:
    data, fit = results.main_data, results.main_fit
    logs = drawn_logs(fit.recorded.logs) if fit is not None and fit.recorded is not None else []
    if pair := _pair(results):
        both = _curves_of_both(results)
        said = "Single levels of both fits, 95 %" if both else "Both fits over the level"
        yield said, "model", partial(_over_level, pair, partial(values.draw_values, with_curves=not both))
    elif fit is not None and logs:
        yield "Measured against model", "model", partial(_log, logs[-1], (fit.data.input_unit, fit.data.output_unit))
    elif data is not None:
        models = model_curves(fit, data)
        said, part = ("Measured against model", "model") if models else ("Measured", "data")
        yield said, part, partial(_steps, data, models)
    elif results.edge_logs:
        log = results.edge_logs[0]
        said = "Output" if log.run.reference_nm is None else "Output against reference"
        yield said, "data", partial(_one_panel, partial(recorded.draw_log, log=log))
        if log.edges:
            yield "Its edges, each from its start", "data", partial(_one_panel, partial(recorded.draw_each, log=log))


def _replays(results: Results) -> Candidates:
    for scenario in SCENARIOS:
        if (one := results.replay(scenario)) is not None:
            yield "Controllers against the reference", "replay", partial(_controllers, one)
            return


def _values(results: Results) -> Candidates:
    """Fitted values over the level; where there is one level, its step with the curve that it asks for."""
    if pair := _pair(results):
        if _curves_of_both(results):
            yield "The models of both fits over the level", "model", partial(_over_level, pair, values.draw_curves)
        return
    fit = results.main_fit
    if fit is None:
        return
    if len(level_values(fit)) > 1:
        yield "Fitted values over the level", "model", partial(_over_level, [("", fit)], values.draw_values)
    for one in results.data:
        if one.result.kind == fit.data.kind and steps.paired(one.result, fit.steps):
            each = partial(steps.draw_level_steps, data=one.result, shapes=fit.steps)
            yield "Steps, each by its own curve", "model", partial(_one_panel, each)


def _pair(results: Results) -> list[tuple[str, Fit]]:
    """Both fits that are put side by side, as A and B; empty where a level of either is not known."""
    pair = [(name, one.result) for name, one in zip("AB", results.pair or (), strict=False) if level_values(one.result)]
    return pair if len(pair) == 2 else []


def _curves_of_both(results: Results) -> bool:
    return all(values.curves_over(fit)[1] for _name, fit in _pair(results))


def _one_panel(draw: Callable[[Axes], None]) -> Figure:
    """One pair of axes, with the legend of what has a name above it."""
    figure, (axes,) = style.sheet(WIDTH_IN, HEIGHT_IN)
    draw(axes)
    if axes.get_legend() is None and axes.get_legend_handles_labels()[1]:
        style.legend_above(axes)
    return figure


def _steps(data: StepSet, fitted: Mapping[float, Model]) -> Figure:
    """Up to six levels, spread over the range: what was measured and the model's curve."""
    few = replace(data, levels=tuple(some_levels(data.levels, 6)))
    return _one_panel(lambda axes: draw_steps(axes, few, fitted))


def _log(log: LogFit, units: tuple[str, str]) -> Figure:
    """(top) the input, (bottom) the measured output and the model driven by that input alone."""
    figure, axes = style.sheet(WIDTH_IN, HEIGHT_IN, 2, 1, sharex=True, height_ratios=(1, 2))
    panels.draw(axes, log_panels(log.curve, units)[:2], "Time of the log (s)")
    for one in axes:
        one.set_title("")
    style.legend_over(figure, axes[1])
    return figure


def _controllers(replay: Replay) -> Figure:
    """(top) reference and the output under each controller, (bottom) the error, where it counts."""
    figure, axes = style.sheet(WIDTH_IN, HEIGHT_IN, 2, 1, sharex=True, height_ratios=(1.6, 1))
    from_s = counted_from(replay)
    shown = {}
    for name, trace in traces_of(replay).items():
        inside = (trace["time_s"] >= from_s) & (trace["time_s"] <= from_s + SHOWN_S)
        shown[name] = {key: trace[key][inside] for key in NEEDED}
    output, error = tracking_panels(shown, units_of(replay), with_error=True)[:2]
    panels.draw(axes, [output, error])
    top = max((float(np.max(np.abs(line.y))) for line in error.lines if len(line.y)), default=1e-9)
    axes[1].set_ylim(-1.1 * top, 1.1 * top)
    for one in axes:
        one.set_title("")
    style.legend_above(axes[0])
    return figure


def _over_level(
    fits: Sequence[tuple[str, Fit]], draw: Callable[[Sequence[Axes], Sequence[tuple[str, Fit]]], None]
) -> Figure:
    """T_s, τ1 and τ2 over the level, of one fit or of two to compare: levels with their intervals, or curves."""
    figure, axes = style.sheet(WIDTH_IN, HEIGHT_IN, 1, 3)
    draw(axes, fits)
    for name, panel in zip(values.NAMES, axes, strict=True):
        panel.set_title(values.axis_label(name, fits[0][1].data.output_unit))
    if len(fits) > 1:
        style.legend_over(figure, axes[0])
    return figure
