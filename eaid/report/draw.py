"""Figures → bytes and files, the same every time: no date, no program name, model ids and hashes fixed."""

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from eaid.errors import UsageError
from eaid.files import written_whole
from eaid.report import style
from eaid.report.available import Ready
from eaid.report.catalogue import FIGURES, Row
from eaid.report.mark import marked
from eaid.report.results import Results

FORMATS = ("png", "pdf", "svg")
COLOURS = 128
"""A figure has a few colours and their blends; 128 draw alike at a third of the bytes."""


@dataclass(frozen=True)
class Drawn:
    """A figure of the catalogue as the page holds it."""

    row: Row
    ready: Ready
    png: bytes
    width_in: float
    height_in: float


def png_of(figure: Figure) -> bytes:
    """A figure as PNG at 300 dpi, without date or program name."""
    from PIL import Image

    figure.canvas.draw()
    canvas = figure.canvas
    image = Image.frombuffer("RGBA", canvas.get_width_height(), canvas.buffer_rgba())  # type: ignore[attr-defined]
    few = image.convert("RGB").quantize(COLOURS, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    out = io.BytesIO()
    few.save(out, format="PNG", dpi=(style.DPI, style.DPI), compress_level=7)
    return out.getvalue()


def vector_of(figure: Figure, kind: str) -> bytes:
    """A figure as PDF (TrueType fonts inside) or SVG (letters as outlines), without date or program name."""
    empty = {"pdf": {"Creator": None, "Producer": None, "CreationDate": None}, "svg": {"Date": None, "Creator": None}}
    out = io.BytesIO()
    figure.savefig(out, format=kind, metadata=empty[kind])
    return out.getvalue()


def formats_of(text: str | None) -> tuple[str, ...]:
    """PNG always, and what `--format pdf,svg` asks for; anything else is refused."""
    wanted = [part.strip().lower() for part in (text or "").split(",") if part.strip()]
    unknown = [part for part in wanted if part not in FORMATS]
    if unknown:
        raise UsageError(f"--format {','.join(unknown)}: figures are written as {', '.join(FORMATS)}")
    return tuple(kind for kind in FORMATS if kind == "png" or kind in wanted)


def ready_figures(results: Results) -> tuple[list[tuple[Row, Ready]], list[Row]]:
    """What can be drawn, and what lacks its data."""
    ready, missing = [], []
    for row in FIGURES:
        found = row.ready(results)
        if found is None:
            missing.append(row)
        else:
            ready.append((row, found))
    return ready, missing


def draw_all(
    ready: Sequence[tuple[Row, Ready]],
    folder: Path,
    formats: Sequence[str],
    done: Callable[[], None],
    mark: str | None = None,
) -> list[Drawn]:
    """Draw every figure once and write it to `folder`/NAME.png (and .pdf, .svg); `done` is called after each.

    `mark` is written above the figures that show the fit of the clutch, or what was made from it.
    """
    drawn = []
    for row, found in ready:
        with style.look():
            figure = found.draw()
            if mark is not None and row.of_the_fit:
                marked(figure, mark)
            png = png_of(figure)
            for kind in formats:
                with written_whole(folder / f"{row.name}.{kind}", force=True) as part:
                    part.write_bytes(png if kind == "png" else vector_of(figure, kind))
            width, height = figure.get_size_inches()
        drawn.append(Drawn(row, found, png, float(width), float(height)))
        done()
    return drawn
