"""The page: one HTML file that needs nothing else, made from the drawn figures, the tables and the verdict."""

import base64
import hashlib
import json
import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from eaid import __version__
from eaid.report import live, sections
from eaid.report.again import commands
from eaid.report.catalogue import FIGURES, Row
from eaid.report.draw import Drawn
from eaid.report.glossary import GLOSSARY
from eaid.report.mark import mark_of
from eaid.report.results import Results, synthetic_of
from eaid.report.trust import verdict

WORDS = {"good": "Good", "care": "Mind", "bad": "Stop"}


@dataclass(frozen=True)
class Shown:
    """A figure as the template needs it."""

    name: str
    title: str
    sees: str
    alt: str
    src: str
    width_px: int
    height_px: int
    narrow: bool
    live: Markup | None


def page(results: Results, drawn: Sequence[Drawn], missing: Sequence[Row]) -> str:
    """The whole page as text."""
    figures = defaultdict(list)
    for one in drawn:
        figures[one.row.section].append(_shown(one))
    library = live.script() if any(one.ready.live for one in drawn) else ""
    starter = _asset("page.js")
    environment = Environment(
        loader=PackageLoader("eaid.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["sign"] = signs
    made_by = synthetic_of(results)
    return environment.get_template("report.html.j2").render(
        title=sections.title(results, made_by),
        synthetic=made_by,
        mark=mark_of(results),
        version=__version__,
        verdict=verdict(results),
        words=WORDS,
        sections=sections.sections(results),
        inputs=sections.inputs(results),
        figures=figures,
        missing=_missing(missing),
        again=commands(results),
        glossary=GLOSSARY,
        style=Markup(_asset("page.css")),
        # Our own scripts only, told by their hash: nothing else on the page can run, whatever a file name says.
        allowed=" ".join(_hash(script) for script in (library, starter) if script),
        library=Markup(library),
        starter=Markup(starter),
    )


def _shown(one: Drawn) -> Shown:
    sees = f"{one.row.sees} {one.ready.note}".strip()
    data = one.ready.live() if one.ready.live else None
    return Shown(
        name=one.row.name,
        title=one.row.title,
        sees=sees,
        alt=f"{one.row.title}. {sees}",
        src="data:image/png;base64," + base64.b64encode(one.png).decode("ascii"),
        width_px=round(one.width_in * 96),
        height_px=round(one.height_in * 96),
        narrow=one.width_in < 5,
        live=Markup(script_safe(data)) if data is not None else None,
    )


def signs(text: str) -> Markup:
    """Our own formulas as HTML: T_s, u^2 and e^(…) get their subscript and superscript; all else is escaped first."""
    safe = str(escape(text))
    safe = re.sub(r"\^\(([^()]*)\)", r"<sup>\1</sup>", safe)
    safe = re.sub(r"(?<=[u%])\^(\d)", r"<sup>\1</sup>", safe)
    return Markup(re.sub(r"\b([TCBKQabc])_([A-Za-z0-9])\b", r"\1<sub>\2</sub>", safe))


def script_safe(data: Mapping[str, Any]) -> str:
    """JSON that may stand inside a script element: no `<`, `>` or `&` is left in it."""
    text = json.dumps(data, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _missing(rows: Sequence[Row]) -> list[tuple[str, str]]:
    """What is not shown, by the command that makes its data; in the order of the page, a comparison is not missed."""
    by_command: dict[str, list[str]] = {}
    for row in FIGURES:
        if row in rows and row.made_by and row.section != "compare":
            by_command.setdefault(row.made_by, []).append(row.title)
    return [(", ".join(titles), command) for command, titles in by_command.items()]


def _hash(script: str) -> str:
    digest = base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")
    return f"'sha256-{digest}'"


def _asset(name: str) -> str:
    return (resources.files("eaid.report") / "templates" / name).read_text(encoding="utf-8")
