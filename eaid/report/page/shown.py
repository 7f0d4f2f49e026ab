"""A figure as the template needs it."""

import base64
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup

from eaid.report.draw import Drawn


@dataclass(frozen=True)
class Shown:
    """A figure: the picture, what is to be seen in it, and its live plots."""

    name: str
    title: str
    sees: str
    src: str
    width_px: int
    height_px: int
    narrow: bool
    live: tuple[Markup, ...] = ()

    @property
    def alt(self) -> str:
        """What a reader who does not see the picture is told."""
        return f"{self.title}. {self.sees}"


def shown(one: Drawn, paper: bool) -> Shown:
    """A drawn figure; numbers of the paper's figures only on the paper's rig."""
    width, height = one.size_in
    title = one.ready.title or (one.row.title if paper else one.row.title.split(" · ")[-1])
    live = one.ready.live() if one.ready.live else ()
    return Shown(
        one.row.name, title, one.ready.sees, source_of(one.preview), round(width * 96), round(height * 96),
        width < 5, tuple(Markup(script_safe(data)) for data in live),
    )  # fmt: skip


def source_of(png: bytes) -> str:
    """A picture as an address that holds it."""
    return "data:image/png;base64," + base64.b64encode(png).decode("ascii")


def script_safe(data: Mapping[str, Any]) -> str:
    """JSON that may stand inside a script element: no `<`, `>` or `&` is left in it."""
    text = json.dumps(data, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
