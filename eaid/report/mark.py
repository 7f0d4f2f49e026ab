"""The mark of results that stand on a fit which its data do not determine: on every page and figure of them."""

from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from eaid.report import style
from eaid.report.results import Results

GAINS = "Fit not identifiable: gains used with --allow-unidentified"
PLANT = "Fit not identifiable: the replays show a model that its data do not determine"
SHORT = "Fit not identifiable: do not quote"
"""What stands above a figure of one column."""
STRIP_IN = 0.2
"""Height that the mark takes above a figure [in]."""


def mark_of(results: Results) -> tuple[str, list[str]] | None:
    """The mark, and why the fit is not identifiable; None where no gains and no replay stand on such a fit."""
    gains = [one.result.unidentified or "" for one in results.gains]
    plants = []
    for replay in results.replays:
        gains.append(replay.result.head.unidentified.get("gains", ""))
        plants.append(replay.result.head.unidentified.get("plant", ""))
    gains, plants = [why for why in gains if why], [why for why in plants if why]
    if not gains and not plants:
        return None
    return (GAINS if gains else PLANT), list(dict.fromkeys([*gains, *plants]))


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
        0.5, 1 - 0.5 * share, SHORT if width < 5 else f"\N{WARNING SIGN} {text}",
        ha="center", va="center", fontsize=style.SMALLEST_PT, fontweight="bold", color=style.VERMILLION,
        in_layout=False,
    )  # fmt: skip
