"""One look for every figure: IEEE column widths, colours for the colour-blind, lines that survive black and white."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

COLUMN_IN = 3.5
"""Width of one IEEE column [in]."""
PAGE_IN = 7.16
"""Width of two IEEE columns [in]."""
DPI = 300

# Okabe & Ito, "Color Universal Design" (2008).
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
YELLOW, BLUE, VERMILLION, PURPLE = "#F0E442", "#0072B2", "#D55E00", "#CC79A7"
GREY = "#6E6E6E"

CONTROLLERS: dict[str, tuple[str, str, str]] = {
    "rc": (BLUE, "-", "o"),
    "pi": (VERMILLION, "--", "s"),
    "open-loop": (GREEN, "-.", "^"),
    "best": (ORANGE, (0, (5, 1)), "v"),  # type: ignore[dict-item]
    "recorded": (GREY, "-", "x"),
    "inverse": (PURPLE, (0, (1, 1)), "D"),  # type: ignore[dict-item]
}
"""Colour, line and marker of a controller, the same in every figure."""
_SPARE = [(ORANGE, "-", "v"), (SKY, "--", "P"), (GREY, "-.", "X"), (BLACK, ":", "*")]

PARAMETERS: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 7.5,
    "axes.titlesize": 8,
    "axes.titlelocation": "left",
    "axes.labelsize": 7.5,
    "axes.linewidth": 0.6,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.4,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "legend.fontsize": 6.8,
    "legend.frameon": True,
    "legend.framealpha": 0.9,
    "legend.edgecolor": "none",
    "legend.handlelength": 2.6,
    "lines.linewidth": 1.1,
    "lines.markersize": 3.6,
    "figure.dpi": DPI,
    "savefig.dpi": DPI,
    "agg.path.chunksize": 20000,
    "path.simplify": True,
    "path.simplify_threshold": 0.2,
    "pdf.fonttype": 42,  # TrueType inside the file; Type 3 is refused by IEEE
    "svg.fonttype": "path",  # outlines: the same look on a machine without the font
    "svg.hashsalt": "eaid",
}


@contextmanager
def look() -> Iterator[None]:
    """The settings under which a figure is made and saved; the caller's own return afterwards."""
    settings: dict[Any, Any] = {**mpl.rcParamsDefault, **PARAMETERS, "backend": mpl.rcParams["backend"]}
    with mpl.rc_context(settings):
        yield


def sheet(
    width_in: float, height_in: float, rows: int = 1, columns: int = 1, **options: Any
) -> tuple[Figure, list[Axes]]:
    """An empty figure and its axes, row by row; no display is needed."""
    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, squeeze=False, **options)
    return figure, list(axes.flat)


def controller_look(name: str, position: int = 0) -> dict[str, Any]:
    """Colour and line of a controller; spare ones for names that this version does not know."""
    colour, line, _ = CONTROLLERS.get(name, _SPARE[position % len(_SPARE)])
    return {"color": colour, "linestyle": line}


def controller_marker(name: str, position: int = 0) -> str:
    """Marker of a controller."""
    return CONTROLLERS.get(name, _SPARE[position % len(_SPARE)])[2]


def controller_name(name: str) -> str:
    """A controller's name as a reader knows it."""
    known = {"rc": "RC", "pi": "PI", "open-loop": "open loop", "inverse": "model inverse", "best": "best possible"}
    return known.get(name, name)


def level_colours(n: int) -> list[str]:
    """Colours for n ordered levels, light to dark as the level rises, so that grey print keeps the order."""
    # cividis is made for colour-blind readers; its palest third is left out, it vanishes on paper.
    table = mpl.colormaps["cividis_r"]
    return [mpl.colors.to_hex(table(0.34 + 0.66 * i / max(n - 1, 1))) for i in range(n)]


def letter(axes: Axes, mark: str, text: str = "") -> None:
    """Head a panel by its letter, as the paper does."""
    axes.set_title(f"({mark}) {text}".rstrip())
