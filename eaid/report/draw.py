"""Figures → bytes, the same every time: no date, no program name, model ids and hashes fixed."""

import base64
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from eaid.errors import UsageError
from eaid.report import style
from eaid.report.catalogue import FIGURES, Row
from eaid.report.live import Live
from eaid.report.results import Results

MARK = "Fit NOT USABLE: do not quote"
STRIP_IN = 0.2
"""Height that the mark takes above a figure [in]."""


def mark_of(results: Results) -> tuple[str, list[str]] | None:
    """The mark, and why; None where no fit is given, and no gains or replays of one, that must not be used."""
    reasons = [one.result.verdict.why for one in results.fits]
    reasons += [one.result.not_usable or "" for one in results.gains]
    reasons += [why for replay in results.replays for why in replay.result.head.not_usable.values()]
    told = list(dict.fromkeys(why for why in reasons if why))
    return (MARK, told) if told else None


def marked(figure: Figure, text: str) -> None:
    """Write a mark above a figure, which grows by a strip for it."""
    width, height = figure.get_size_inches()
    figure.set_size_inches(width, height + STRIP_IN)
    share = STRIP_IN / (height + STRIP_IN)
    if isinstance(engine := figure.get_layout_engine(), ConstrainedLayoutEngine):
        engine.set(rect=(0, 0, 1, 1 - share))
    if figure.legends:
        figure.draw_without_rendering()  # lays the panels out below the legends, which then come down with them
        figure.set_layout_engine("none")
    for legend in figure.legends:
        legend.set_bbox_to_anchor((0, 0, 1, 1 - share), transform=figure.transFigure)
    figure.text(
        0.5, 1 - 0.5 * share, f"\N{WARNING SIGN} {text}",
        ha="center", va="center", fontsize=style.SMALLEST_PT, fontweight="bold", color=style.VERMILLION,
        in_layout=False,
    )  # fmt: skip


FORMATS = ("png", "pdf", "svg")
COLOURS = 128
"""A figure has a few colours and their blends; 128 draw alike at a third of the bytes."""
PAGE_DPI = 170
"""Sharpness of the figures inside the page: the files beside it have 300 dpi."""


@dataclass(frozen=True)
class Drawn:
    """A figure of the catalogue: the files to write, and what the page shows of it."""

    name: str
    title: str
    sees: str
    files: tuple[tuple[str, bytes], ...]
    """Format and content."""
    src: str
    """The picture, as an address that holds it."""
    size_in: tuple[float, float]
    live: tuple[Live, ...] = ()

    @property
    def size_px(self) -> tuple[int, int]:
        """Size of the picture on the page."""
        return round(self.size_in[0] * 96), round(self.size_in[1] * 96)

    @property
    def narrow(self) -> bool:
        """Whether it has one column."""
        return self.size_in[0] < 5

    @property
    def alt(self) -> str:
        """What a reader who does not see the picture is told."""
        return f"{self.title}. {self.sees}"


def source_of(png: bytes) -> str:
    """A picture as an address that holds it."""
    return "data:image/png;base64," + base64.b64encode(png).decode("ascii")


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


def chosen(names: Sequence[str]) -> tuple[Row, ...]:
    """The figures whose names begin with one of `names`; all without any; a name that fits none is refused."""
    unknown = [name for name in names if not any(row.name.startswith(name) for row in FIGURES)]
    if unknown:
        raise UsageError(
            f"«figures» {','.join(unknown)}: no such figure; there are {', '.join(r.name for r in FIGURES)}"
        )
    return tuple(row for row in FIGURES if not names or any(row.name.startswith(name) for name in names))


def draw_all(
    results: Results, rows: Sequence[Row], formats: Sequence[str], done: Callable[[], None], mark: str | None
) -> list[Drawn]:
    """Draw every figure of `rows` whose data are given; `done` is called after each row.

    `mark` is written above the figures that show the fit of the clutch, or what was made from it.
    """
    drawn = []
    for row in rows:
        with style.look():
            if (ready := row.ready(results)) is not None:
                figure = ready.figure
                if mark is not None and row.of_the_fit:
                    marked(figure, mark)
                png, preview = pngs_of(figure, style.DPI, PAGE_DPI)
                files = tuple((kind, png if kind == "png" else vector_of(figure, kind)) for kind in formats)
                width, height = (float(side) for side in figure.get_size_inches())
                source = source_of(preview)
                drawn.append(Drawn(row.name, ready.title, ready.sees, files, source, (width, height), ready.live))
        done()
    return drawn
