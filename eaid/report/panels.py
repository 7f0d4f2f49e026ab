"""What a figure is: panels of lines, bands, spans and notes, in numbers and words alone.

`paper` draws it with matplotlib for files, `live` with Bokeh for the page. Words are written as in tables: T_s, τ1.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from eaid.arrays import Array, extremes
from eaid.shown import input_word, output_word

COLUMN_IN, PAGE_IN = 3.5, 7.16  # Widths of a figure of one and of both columns of a journal [in]

# Okabe & Ito, "Color Universal Design" (2008).
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILLION, PURPLE = "#0072B2", "#D55E00", "#CC79A7"
GREY, PALE = "#6E6E6E", "#EEEEEE"
Dash = str | tuple[int, tuple[int, ...]]  # A line's dashes as matplotlib has them; none: ""


@dataclass(frozen=True)
class Axis:
    """What runs along an axis, its unit, its limits (None: by the data)."""

    name: str = ""
    unit: str = ""
    limits: tuple[float | None, float | None] = (None, None)
    log: bool = False
    ticks: Mapping[float, str] | None = None

    @property
    def text(self) -> str:
        """Name and unit as they stand beside the axis."""
        return f"{self.name} ({self.unit})" if self.unit else self.name


TIME, OF_STEP, OF_LOG = Axis("Time", "s"), Axis("Time since the step", "s"), Axis("Time of the log", "s")


def quantity(unit: str, *limits: float | None) -> Axis:
    """The axis of an output, by its unit."""
    return Axis(output_word(unit).capitalize(), unit, limits or (None, None))  # type: ignore[arg-type]


def over(unit: str) -> Axis:
    """The axis that levels run along."""
    return Axis(input_word(unit).capitalize(), unit)


@dataclass(frozen=True, eq=False)
class Line:
    """A curve, or points with a marker, perhaps with whiskers; `name` is for legend and pointer, `end` at its end."""

    x: Any  # An array, or numbers
    y: Any
    name: str = ""
    color: str = BLACK
    dash: Dash = "-"
    width: float = 0.9  # On paper [pt]
    marker: str = ""
    size: float = 3.6  # Of the marker [pt]
    fill: str = ""  # Of the marker; empty: its colour
    alpha: float = 1.0
    ends: tuple[Array, Array] | None = None  # Lower and upper ends of the whiskers
    end: str = ""


def model_line(x: Array, y: Array, name: str) -> Line:
    """A thin dark dashed line over the broader, paler one of what was measured: both stay to be seen."""
    return Line(x, y, name, BLACK, (0, (4, 2)), 1.0)


@dataclass(frozen=True, eq=False)
class Band:
    """What lies between two curves."""

    x: Array
    low: Array
    high: Array
    color: str
    alpha: float = 0.25


@dataclass(frozen=True)
class Span:
    """A stretch of an axis, shaded across the panel; a line where both ends are one."""

    low: float
    high: float
    color: str
    along: str = "x"
    width: float = 0.6
    dash: Dash = "-"


@dataclass(frozen=True)
class Note:
    """A text on paper; x and y by the data, or as a share of the panel where `of` says so: `x`, `y`, `xy`."""

    text: str
    x: float
    y: float
    of: str = ""
    ha: str = "center"
    va: str = "center"
    boxed: bool = False


@dataclass(frozen=True, eq=False)
class Panel:
    """One pair of axes."""

    x: Axis
    y: Axis
    lines: Sequence[Line] = ()
    bands: Sequence[Band] = ()
    spans: Sequence[Span] = ()
    notes: Sequence[Note] = ()
    legend: str = ""  # Where the names stand: `above` the panel, `beside` it, or `over` all panels; empty: nowhere
    columns: int = 5  # Of the legend
    keys: Sequence[Line] = ()  # What the legend shows in place of the lines, whose names are then for the pointer alone
    title: str = ""
    tight: bool = True  # Whether the lines reach both sides
    boxes: Sequence[tuple[str, Array, str, str]] = ()  # On paper: name, values, colour and hatch of each box plot


@dataclass(frozen=True, eq=False)
class Sheet:
    """Panels row by row."""

    panels: Sequence[Panel]
    height_in: float
    width_in: float = PAGE_IN
    columns: int = 1
    ratios: tuple[float, ...] = ()  # Heights of the rows
    widths: tuple[float, ...] = ()
    shared: bool = True  # Whether panels of one column have one x axis
    lettered: bool = True
    live: bool = False  # Whether the page has it, of one column, as a plot that can be zoomed


def level_colours(n: int) -> list[str]:
    """Colours for n ordered levels, light to dark as the level rises, so that grey print keeps the order."""
    import matplotlib as mpl

    table = mpl.colormaps["cividis_r"]  # made for colour-blind readers; its palest third vanishes on paper
    return [mpl.colors.to_hex(table(0.34 + 0.66 * i / max(n - 1, 1))) for i in range(n)]


# Colour, line and marker of a controller, the same in every figure
CONTROLLER_STYLES: dict[str, tuple[str, Dash, str]] = {
    "rc": (BLUE, "-", "o"),
    "pi": (VERMILLION, "--", "s"),
    "open-loop": (GREEN, "-.", "^"),
    "inverse": (PURPLE, (0, (1, 1)), "D"),
    "pi-feedforward": (ORANGE, (0, (3, 1, 1, 1)), "v"),
    "smith": (SKY, (0, (5, 1)), "P"),
}


def controller_look(name: str) -> tuple[str, Dash, str]:
    """Colour, line and marker of a controller; of a name that this version does not know, black dots."""
    return CONTROLLER_STYLES.get(name, (BLACK, ":", "*"))


def move_apart(values: Sequence[float], gap: float) -> list[float]:
    """Rising values moved apart, neighbours both by half, until none are closer than the gap, or nearly so."""
    placed = list(values)
    for _ in range(200):
        for i in range(len(placed) - 1):
            lack = max(gap - (placed[i + 1] - placed[i]), 0.0)
            placed[i], placed[i + 1] = placed[i] - lack / 2, placed[i + 1] + lack / 2
    return placed


def thinned(x: Array, y: Array, points: int) -> tuple[Array, Array]:
    """At most `points` + 2 samples of a curve, the extremes of equal stretches in order: a spike of one survives."""
    keep = extremes([y], max(points // 2, 1))
    return x[keep], y[keep]
