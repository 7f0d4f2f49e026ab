"""The page as text: the first screen and the parts, put into the template; what logs say is escaped."""

import base64
import hashlib
import re
from collections.abc import Sequence
from functools import cache
from importlib import resources

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from eaid.report import live
from eaid.report.catalogue import Row
from eaid.report.draw import Drawn, mark_of
from eaid.report.page import summary
from eaid.report.page.known import Terms, known
from eaid.report.page.next_steps import next_steps
from eaid.report.page.parts import parts
from eaid.report.page.summary import tiles
from eaid.report.pictures import Picture
from eaid.report.results import Results
from eaid.report.tables.table import Cell, Name, text
from eaid.version import __version__

WORDS = {"good": "Good", "care": "Warning", "bad": "Stop", "none": "–"}
SEVERITIES = {"stop": ("bad", "Stop"), "caution": ("care", "Warning"), "note": ("good", "Note")}


def page(
    results: Results,
    drawn: Sequence[Drawn],
    pictures: Sequence[Picture],
    missing: Sequence[Row],
) -> str:
    """The whole page as text."""
    found, terms = known(results), Terms()
    numbers = tiles(results)
    library = live.script() if any(one.live for one in drawn) else ""
    starter = _asset("page.js")
    told = tuple(f"{one.label} {one.note}" for one in numbers)
    first_terms = terms.first_in((*told, *(one.title for one in pictures), "" if results.shows_edges else "level"))
    return _environment().get_template("report.html.j2").render(
        title=summary.title(results),
        synthetic=results.synthetic,
        chips=summary.chips(results),
        mark=mark_of(results),
        version=__version__,
        lights=summary.lights(results, found),
        pictures=pictures,
        tiles=numbers,
        next_steps=next_steps(results),
        terms=[(word, says) for word, says in first_terms if word not in _EXPLAINED],
        parts=parts(results, found, {one.name: one for one in drawn}, terms),
        missing=[(", ".join(titles), command) for command, titles in _missing(missing).items()],
        style=Markup(_asset("page.css")),
        # Our own scripts only, told by their hash: nothing else on the page can run, whatever a file name says.
        allowed=" ".join(_hash(script) for script in (library, starter) if script),
        library=Markup(library),
        starter=Markup(starter),
    )  # fmt: skip


_EXPLAINED = {"T_s", "τ1, τ2", "fit %", "synthetic"}
"""Words that the tiles and chips themselves explain."""


@cache
def _environment() -> Environment:
    made = Environment(
        loader=PackageLoader("eaid.report.page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters["sign"] = signs
    made.globals |= {"words": WORDS, "severities": SEVERITIES, "cell": _cell}
    return made


def _cell(cell: Cell, digits: int) -> Markup:
    """A cell as HTML: formulas are set, names that users chose are not."""
    return escape(str(cell)) if isinstance(cell, Name) else signs(text(cell, digits))


def signs(said: str) -> Markup:
    """Our own formulas as HTML: T_s, u^2 and e^(…) get their subscript and superscript; all else is escaped first."""
    safe = str(escape(str(said)))
    if isinstance(said, Name):
        return Markup(safe)
    safe = re.sub(r"\^\(([^()]*)\)", r"<sup>\1</sup>", safe)
    safe = re.sub(r"(?<=[u%A-Za-z])\^(\d)", r"<sup>\1</sup>", safe)
    return Markup(re.sub(r"\b([TCBKQabc])_([A-Za-z0-9])\b", r"\1<sub>\2</sub>", safe))


def _missing(rows: Sequence[Row]) -> dict[str, list[str]]:
    """What is not shown, by the command that makes its data."""
    by_command: dict[str, list[str]] = {}
    for row in rows:
        if row.made_by:
            by_command.setdefault(row.made_by, []).append(row.title)
    return by_command


def _hash(script: str) -> str:
    digest = base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")
    return f"'sha256-{digest}'"


def _asset(name: str) -> str:
    return (resources.files("eaid.report.page") / "templates" / name).read_text(encoding="utf-8")
