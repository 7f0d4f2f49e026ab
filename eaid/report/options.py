"""How a report is made."""

from dataclasses import dataclass

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
