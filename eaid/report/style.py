"""One look for every figure: column widths, letters of 8 pt and more, colours for the colour-blind, lines that survive
black and white."""

from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypedDict

import matplotlib as mpl
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from eaid.report.rig import level_text
from eaid.report.tables.table import listed, number

DPI = 300
SMALLEST_PT = 8.0
"""No letter of a figure is smaller at its printed size [pt]; indices of symbols follow their letter."""


COLUMN_IN, PAGE_IN = 3.5, 7.16
"""Widths of a figure of one and of both columns of a journal [in]."""

# Okabe & Ito, "Color Universal Design" (2008).
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILLION, PURPLE = "#0072B2", "#D55E00", "#CC79A7"
GREY = "#6E6E6E"


class Stroke(TypedDict, total=False):
    """How matplotlib draws a line."""

    color: str
    linestyle: Any
    linewidth: float


CONTROLLERS: dict[str, tuple[str, str, str]] = {
    "rc": (BLUE, "-", "o"),
    "pi": (VERMILLION, "--", "s"),
    "open-loop": (GREEN, "-.", "^"),
    "recorded": (GREY, "-", "x"),
    "inverse": (PURPLE, (0, (1, 1)), "D"),  # type: ignore[dict-item]
}
"""Colour, line and marker of a controller, the same in every figure."""
_SPARE = [(ORANGE, "-", "v"), (SKY, "--", "P"), (GREY, "-.", "X"), (BLACK, ":", "*")]


@cache
def _parameters() -> dict[Any, Any]:
    """matplotlib's defaults, and ours over them."""
    return dict(mpl.rc_params_from_file(Path(__file__).with_name("figures.mplstyle")))


def look() -> AbstractContextManager[None]:
    """The settings under which a figure is made and saved; the caller's own return afterwards."""
    return mpl.rc_context({**_parameters(), "backend": mpl.rcParams["backend"]})


def sheet(
    width_in: float, height_in: float, rows: int = 1, columns: int = 1, **options: Any
) -> tuple[Figure, list[Axes]]:
    """An empty figure of any width and its axes, row by row."""
    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, squeeze=False, **options)
    return figure, list(axes.flat)


def legend_above(axes: Axes, columns: int = 5) -> None:
    """The legend above the axes, off the data."""
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns)


def legend_over(figure: Figure, axes: Axes, columns: int = 6) -> None:
    """One legend for all panels, above them, off the data."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=columns)


def controller_look(name: str, position: int = 0) -> Stroke:
    """Colour and line of a controller; spare ones for names that this version does not know."""
    colour, line, _ = CONTROLLERS.get(name, _SPARE[position % len(_SPARE)])
    return {"color": colour, "linestyle": line}


def controller_marker(name: str, position: int = 0) -> str:
    """Marker of a controller."""
    return CONTROLLERS.get(name, _SPARE[position % len(_SPARE)])[2]


def level_colours(n: int) -> list[str]:
    """Colours for n ordered levels, light to dark as the level rises, so that grey print keeps the order."""
    table = level_map()
    return [mpl.colors.to_hex(table(i / max(n - 1, 1))) for i in range(n)]


def level_map() -> mpl.colors.LinearSegmentedColormap:
    """Colours of levels: cividis, made for colour-blind readers, without its palest third, which vanishes on paper."""
    table = mpl.colormaps["cividis_r"]
    return mpl.colors.LinearSegmentedColormap.from_list("levels", [table(0.34 + 0.66 * k / 63) for k in range(64)])


def letter(axes: Axes, mark: str, text: str = "") -> None:
    """Head a panel by its letter, as the paper does."""
    axes.set_title(f"({mark}) {text}".rstrip())


@dataclass(frozen=True)
class Ready:
    """A figure that is drawn, and its words."""

    figure: Figure
    sees: str
    """What is to be seen in it; every claim computed."""
    live: tuple[Markup, ...] = ()
    """Its live plots, side by side."""
    title: str = ""
    """Empty: as in the catalogue, without the paper's number on another rig."""


@cache
def _captions() -> Any:
    made = Environment(loader=PackageLoader("eaid.report", "."), undefined=StrictUndefined)
    made.filters |= {"n": number, "at": level_text, "listed": listed}
    return made.get_template("captions.j2").module


def caption(name: str, **numbers: Any) -> str:
    """The words of one figure with its numbers."""
    return str(getattr(_captions(), name)(**numbers))
