"""Figures → bytes, the same every time: no date, no program name, model ids and hashes fixed."""

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from matplotlib import font_manager
from matplotlib.figure import Figure

from eaid.errors import UsageError
from eaid.report import style
from eaid.report.catalogue import FIGURES, Row
from eaid.report.figures import summary
from eaid.report.figures.edges import draw_each, draw_log
from eaid.report.figures.recorded import drawn_logs
from eaid.report.figures.values import curves_over, draw_curves, draw_values
from eaid.report.mark import marked
from eaid.report.ready import Ready
from eaid.report.ready_fits import main_kind, models_for
from eaid.report.ready_replays import counted_from, traces_of
from eaid.report.results import Results
from eaid.report.rig import level_values

FORMATS = ("png", "pdf", "svg")
COLOURS = 128
"""A figure has a few colours and their blends; 128 draw alike at a third of the bytes."""
PAGE_DPI = 170
"""Sharpness of the figures inside the page: the files beside it have 300 dpi."""


@dataclass(frozen=True)
class Drawn:
    """A figure of the catalogue: the files to write, and the picture for the page."""

    row: Row
    ready: Ready
    files: tuple[tuple[str, bytes], ...]
    """Format and content."""
    preview: bytes
    size_in: tuple[float, float]


@dataclass(frozen=True)
class Picture:
    """A picture of the first screen."""

    title: str
    part: str
    png: bytes
    size_px: tuple[int, int]


def pngs_of(figure: Figure, *dpis: float) -> tuple[bytes, ...]:
    """A figure as PNG, drawn once and made smaller for each further sharpness; without date or program name."""
    from PIL import Image

    figure.set_dpi(dpis[0])
    figure.canvas.draw()
    canvas = figure.canvas
    drawn = Image.frombuffer("RGBA", canvas.get_width_height(), canvas.buffer_rgba()).convert("RGB")  # type: ignore[attr-defined]
    found = []
    for dpi in dpis:
        width, height = (round(side * dpi / dpis[0]) for side in drawn.size)
        image = drawn if dpi == dpis[0] else drawn.resize((width, height), Image.Resampling.LANCZOS)
        out = io.BytesIO()
        few = image.quantize(COLOURS, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
        few.save(out, format="PNG", dpi=(dpi, dpi), compress_level=7)
        found.append(out.getvalue())
    return tuple(found)


def vector_of(figure: Figure, kind: str) -> bytes:
    """A figure as PDF (TrueType fonts inside) or SVG (letters as outlines), without date or program name."""
    empty = {"pdf": {"Creator": None, "Producer": None, "CreationDate": None}, "svg": {"Date": None, "Creator": None}}
    out = io.BytesIO()
    figure.savefig(out, format=kind, metadata=empty[kind], dpi=style.DPI)
    return out.getvalue()


def formats_of(wanted: Sequence[str]) -> tuple[str, ...]:
    """PNG always, and what else is asked for; anything else is refused."""
    unknown = [part for part in wanted if part not in FORMATS]
    if unknown:
        raise UsageError(f"«format» {','.join(unknown)}: figures are written as {', '.join(FORMATS)}")
    return tuple(kind for kind in FORMATS if kind == "png" or kind in wanted)


def font_of(name: str) -> str:
    """A font that is installed; anything else is refused."""
    try:
        font_manager.findfont(name, fallback_to_default=False)
    except ValueError:
        near = sorted({one.name for one in font_manager.fontManager.ttflist})
        raise UsageError(f"«font» {name}: no such font is installed; there are {', '.join(near[:12])}") from None
    return name


def chosen(names: Sequence[str]) -> tuple[Row, ...]:
    """The figures whose names begin with one of `names`; all without any; a name that fits none is refused."""
    unknown = [name for name in names if not any(row.name.startswith(name) for row in FIGURES)]
    if unknown:
        raise UsageError(
            f"«figures» {','.join(unknown)}: no such figure; there are {', '.join(r.name for r in FIGURES)}"
        )
    return tuple(row for row in FIGURES if not names or any(row.name.startswith(name) for name in names))


def ready_figures(
    results: Results, asked: bool | None = None, names: Sequence[str] = ()
) -> tuple[list[tuple[Row, Ready]], list[Row]]:
    """What can be drawn, and what lacks its data."""
    rows = [(row, row.ready(results, asked)) for row in chosen(names)]
    return [(row, ready) for row, ready in rows if ready is not None], [row for row, ready in rows if ready is None]


def draw_all(
    ready: Sequence[tuple[Row, Ready]],
    formats: Sequence[str],
    done: Callable[[], None],
    look: style.Look = style.PAPER,
    mark: str | None = None,
) -> list[Drawn]:
    """Draw every figure once; `done` is called after each.

    `mark` is written above the figures that show the fit of the clutch, or what was made from it.
    """
    drawn = []
    for row, found in ready:
        with style.look(look):
            figure = found.draw()
            if mark is not None and row.of_the_fit:
                marked(figure, mark)
            png, preview = pngs_of(figure, style.DPI, PAGE_DPI)
            files = tuple((kind, png if kind == "png" else vector_of(figure, kind)) for kind in formats)
            width, height = figure.get_size_inches()
            drawn.append(Drawn(row, found, files, preview, (float(width), float(height))))
        done()
    return drawn


def summary_pictures(results: Results, mark: str | None = None) -> list[Picture]:
    """The first screen: the model against its data, and the controllers or the fitted values."""
    pictures = []
    for title, part, make in _pictures(results)[:2]:
        with style.look():
            figure = make()
            if mark is not None:
                marked(figure, mark)
            size = figure.get_size_inches()
            (png,) = pngs_of(figure, 200)
            pictures.append(Picture(title, part, png, (round(96 * size[0]), round(96 * size[1]))))
    return pictures


def _pictures(results: Results) -> list[tuple[str, str, Callable[[], Figure]]]:
    """Title, part of the page and drawing of each candidate, the best first."""
    found: list[tuple[str, str, Callable[[], Figure]]] = []
    beside: tuple[str, str, Callable[[], Figure]] | None = None
    kind = main_kind(results)
    data, fit = (results.data_of(kind), results.fit(kind)) if kind else (None, None)
    pair = [(name, one.result) for name, one in zip("AB", results.pair or (), strict=False) if level_values(one.result)]
    logs = drawn_logs(fit.recorded.logs) if fit is not None and fit.recorded is not None else []
    if len(pair) == 2:
        both = all(curves_over(fit)[1] for _name, fit in pair)
        draw_levels = partial(draw_values, with_curves=not both)
        said = "Single levels of both fits, 95 %" if both else "Both fits over the level"
        found.append((said, "model", lambda: summary.values_over_level(pair, draw_levels)))
        if both:
            curves = lambda: summary.values_over_level(pair, draw_curves)  # noqa: E731
            beside = ("The models of both fits over the level", "model", curves)
    elif fit is not None and logs:
        units = fit.data.input_unit, fit.data.output_unit
        found.append(("Measured against model", "model", lambda: summary.log_and_model(logs[-1], units)))
    elif data is None and results.edge_logs:
        log = results.edge_logs[0]
        said = "Output" if log.run.reference_nm is None else "Output against reference"
        found.append((said, "data", lambda: summary.one_panel(lambda axes: draw_log(axes, log))))
        if log.edges:
            found.append(
                ("Its edges, each from its start", "data", lambda: summary.one_panel(lambda axes: draw_each(axes, log)))
            )
    elif data is not None and data.levels:
        models = models_for(results, kind or "")
        said = "Measured against model" if models else "Measured"
        found.append((said, "model" if models else "data", lambda: summary.measured_and_model(data, models)))
    order = {"multisine": 0, "reference": 1, "steps": 2}
    replays = sorted((one.result for one in results.replays), key=lambda one: order.get(one.head.scenario, 9))
    if replays and (one := replays[0]).head.scenario in order:
        unit = one.head.output_unit
        draw = lambda: summary.controllers(traces_of(one), counted_from(one), unit)  # noqa: E731
        found.append(("Controllers against the reference", "replay", draw))
    if beside is not None:
        found.append(beside)
    if len(pair) < 2 and fit is not None and level_values(fit):
        found.append(("Fitted values over the level", "model", lambda: summary.values_over_level([("", fit)])))
    return found
