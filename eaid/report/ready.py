"""A figure whose data are at hand: how it is drawn, what is to be seen in it, and its live plots."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure

from eaid.report.live import Live
from eaid.report.rig import level_text
from eaid.report.tables.table import listed, number


@dataclass(frozen=True)
class Ready:
    """A figure whose data are at hand."""

    draw: Callable[[], Figure]
    sees: str
    """What is to be seen in it; every claim computed."""
    live: Callable[[], tuple[Live, ...]] = tuple
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
