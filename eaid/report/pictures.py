"""The two pictures of the first screen: the model against its data, and the controllers or the fitted values."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

from matplotlib.figure import Figure

from eaid.report import style
from eaid.report.draw import pngs_of
from eaid.report.figures import edges, level_steps, summary, values
from eaid.report.figures.recorded import drawn_logs
from eaid.report.mark import marked
from eaid.report.ready_fits import models_for
from eaid.report.ready_replays import counted_from, traces_of
from eaid.report.results import Results
from eaid.report.rig import level_values
from eaid.results.fit import Fit

SCENARIOS = ("multisine", "reference", "steps")
"""Replays that are shown, the best first."""


@dataclass(frozen=True)
class Picture:
    """A picture of the first screen."""

    title: str
    part: str
    """Where on the page more of it stands."""
    png: bytes
    size_px: tuple[int, int]


@dataclass(frozen=True)
class Candidate:
    """A picture that could be drawn."""

    title: str
    part: str
    draw: Callable[[], Figure]


def summary_pictures(results: Results, mark: str | None = None) -> list[Picture]:
    """The first two candidates, drawn."""
    candidates = [*_data_and_model(results), *_replays(results), *_values(results)]
    pictures = []
    for one in candidates[:2]:
        with style.look():
            figure = one.draw()
            if mark is not None:
                marked(figure, mark)
            size = figure.get_size_inches()
            (png,) = pngs_of(figure, 200)
            pictures.append(Picture(one.title, one.part, png, (round(96 * size[0]), round(96 * size[1]))))
    return pictures


def _data_and_model(results: Results) -> Iterator[Candidate]:
    data, fit = results.main_data, results.main_fit
    logs = drawn_logs(fit.recorded.logs) if fit is not None and fit.recorded is not None else []
    if pair := _pair(results):
        both = _curves_of_both(results)
        said = "Single levels of both fits, 95 %" if both else "Both fits over the level"
        draw = partial(values.draw_values, with_curves=not both)
        yield Candidate(said, "model", lambda: summary.values_over_level(pair, draw))
    elif fit is not None and logs:
        units = fit.data.input_unit, fit.data.output_unit
        yield Candidate("Measured against model", "model", lambda: summary.log_and_model(logs[-1], units))
    elif data is not None:
        models = models_for(fit, data)
        said, part = ("Measured against model", "model") if models else ("Measured", "data")
        yield Candidate(said, part, lambda: summary.measured_and_model(data, models))
    elif results.edge_logs:
        log = results.edge_logs[0]
        said = "Output" if log.run.reference_nm is None else "Output against reference"
        yield Candidate(said, "data", lambda: summary.one_panel(lambda axes: edges.draw_log(axes, log)))
        if log.edges:
            each = lambda: summary.one_panel(lambda axes: edges.draw_each(axes, log))  # noqa: E731
            yield Candidate("Its edges, each from its start", "data", each)


def _replays(results: Results) -> Iterator[Candidate]:
    for scenario in SCENARIOS:
        if (one := results.replay(scenario)) is not None:
            draw = partial(summary.controllers, traces_of(one), counted_from(one), one.head.output_unit)
            yield Candidate("Controllers against the reference", "replay", draw)
            return


def _values(results: Results) -> Iterator[Candidate]:
    """Fitted values over the level; where there is one level, its step with the curve that it asks for."""
    if pair := _pair(results):
        if _curves_of_both(results):
            draw = lambda: summary.values_over_level(pair, values.draw_curves)  # noqa: E731
            yield Candidate("The models of both fits over the level", "model", draw)
        return
    fit = results.main_fit
    if fit is not None and len(level_values(fit)) > 1:
        yield Candidate("Fitted values over the level", "model", lambda: summary.values_over_level([("", fit)]))
    for one in results.data if fit is not None else ():
        if fit is not None and one.result.kind == fit.data.kind and level_steps.paired(one.result, fit.steps):
            draw_steps = partial(level_steps.draw_level_steps, data=one.result, shapes=fit.steps)
            yield Candidate("Steps, each by its own curve", "model", partial(summary.one_panel, draw_steps))


def _pair(results: Results) -> list[tuple[str, Fit]]:
    """Both fits that are put side by side, as A and B; empty where a level of either is not known."""
    pair = [(name, one.result) for name, one in zip("AB", results.pair or (), strict=False) if level_values(one.result)]
    return pair if len(pair) == 2 else []


def _curves_of_both(results: Results) -> bool:
    return all(values.curves_over(fit)[1] for _name, fit in _pair(results))
