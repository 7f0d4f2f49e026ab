"""How a report is made, and what it leaves alone."""

from dataclasses import dataclass
from pathlib import Path

from eaid.errors import UsageError

PAGE = "report.html"
FIGURES = "figures"
NAMES = (
    "fig", "compare", "model_over_duty", "residuals_", "input_gain", "own_reference", "level_steps", "guarantee_in",
    "log_replay", "steps_over_level", "recorded_logs", "bode", "walls", "edges",
)  # fmt: skip
"""How the names of a report's figures begin."""
COLUMN_IN = 3.5
"""Width of one IEEE column [in]."""
PAGE_IN = 7.16
"""Width of two IEEE columns [in]."""


@dataclass(frozen=True)
class ReportOptions:
    """How a report is made."""

    formats: tuple[str, ...] = ("png",)
    """PNG always; pdf and svg where asked for."""
    figures: tuple[str, ...] = ()
    """Names, or beginnings of names, of the figures that are wanted; empty: all that the results allow."""
    column_in: float = COLUMN_IN
    """Width of a figure of one column [in]."""
    page_in: float = PAGE_IN
    """Width of a figure of both columns [in]."""
    font: str = "DejaVu Sans"
    """Letters of the figures; has to be installed."""
    paper: bool | None = None
    """Published values beside ours: None where the units are those of the paper's rig."""
    force: bool = False
    """Whether what the folder holds is written over."""


USUAL = ReportOptions()


def refuse_to_overwrite_report(folder: Path, force: bool) -> None:
    """Leave an existing report alone, its figures too, unless the user says otherwise."""
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder}: is a file; give the report a folder with «output»")
    held = [folder / PAGE] * (folder / PAGE).exists() + figures_in(folder)
    if held and not force:
        raise UsageError(f"{held[0]}: exists already; give «force» to overwrite the report, or another «output»")


def figures_in(folder: Path) -> list[Path]:
    """Figures of a report that a folder holds."""
    held = sorted((folder / FIGURES).glob("*")) if (folder / FIGURES).is_dir() else []
    return [path for path in held if path.suffix in (".png", ".pdf", ".svg") and path.stem.startswith(NAMES)]
