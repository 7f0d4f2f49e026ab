"""The page: one HTML file that needs nothing else.

The first screen, then the parts, each a picture first, one table, and the rest folded with a count; what logs say is
escaped.
"""

import base64
import hashlib
import itertools
import os
import re
import shlex
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from eaid.export.export import offered
from eaid.findings import Finding, advised, enumerated
from eaid.findings.finding import MOST_TOLD, WORD
from eaid.report import live
from eaid.report.page import summary
from eaid.report.page.summary import GRADES, ByPart, sentence
from eaid.report.results import EXPERIMENT_NAMES, Given, Results
from eaid.report.tables import Name, Table, cell_text, data, fits, gains, replays, sessions, table_of
from eaid.results.fit import Fit
from eaid.sessions.compare import Comparison
from eaid.shown import counted
from eaid.version import __version__

OPEN_ROWS = 24  # Most rows of a table that stands open
KIND_FIGURES = {
    "clutch": ("recorded_logs", "fig07_nonlinear_model", "level_steps", "model_over_duty",
               "residuals", "fig08_linear_model", "fig09_shear_per_field"),
    "friction-force": ("fig03_friction_steps", "level_steps", "fig04_friction_over_stress", "residuals"),
    "friction-speed": ("fig03_friction_steps", "level_steps", "fig05_friction_over_speed", "residuals"),
}  # fmt: skip


@dataclass(frozen=True)
class PageFigure:
    """A figure as the page shows it."""

    name: str
    title: str
    sees: str
    src: str  # The picture, as an address that holds it
    size_px: tuple[int, int]
    live: str = ""

    @property
    def narrow(self) -> bool:
        """Whether it has one column."""
        return self.size_px[0] < 480


Figures = dict[str, PageFigure]


@dataclass(frozen=True)
class Block:
    """A part of the page, or what stands closed in it under a line that counts and names it."""

    title: str
    figures: tuple[PageFigure, ...] = ()
    tables: tuple[Table, ...] = ()
    findings: tuple[tuple[str, str], ...] = ()  # Severity and sentence of each
    lines: tuple[str, ...] = ()  # Command lines
    folds: "tuple[Block, ...]" = ()

    @property
    def count(self) -> str:
        """How much there is."""
        parts = ((len(self.figures), "figure"), (len(self.tables), "table"), (len(self.findings), "finding"))
        return " and ".join(counted(n, word) for n, word in parts if n)

    @property
    def names(self) -> str:
        """What there is, by name."""
        figures = [figure.title.split(" · ")[-1] for figure in self.figures]
        return enumerated([*figures, *(table.heading for table in self.tables)])


def parts(results: Results, drawn: Figures) -> list[Block]:
    """The parts that have anything to show, in the order of the page."""
    known = summary.known_findings(results)
    rehab = results.replay("rehab")
    others = [given.result for given in results.replays if given.result.head.scenario != "rehab"]
    tracked = [replay for replay in others if replay.head.scenario != "log"]
    replayed = [
        *([replays.errors_table(tracked)] if tracked else []),
        *(replays.log_table(one, [fit.result for fit in results.fits]) for one in others),
    ]
    replayed += [table for replay in tracked for table in replays.further_tables(replay)]
    shown = _of(drawn, "fig12_multisine", "own_reference", "fig11_steps", "log_replay")
    again = Block("How to do it again", lines=tuple(commands(results)))
    files = table_of(
        "Files", "The fingerprint (SHA-256) tells one version of a file from another.", _files(results),
        ("file", lambda one: Name(one[0].path)), ("what it is", lambda one: Name(one[1])),
        ("fingerprint", lambda one: Name(one[0].sha256)),
    )  # fmt: skip
    every = [
        _sessions_part(results, known, drawn),
        _data_part(results, known, drawn),
        _model_part(results, known, drawn),
        _controller_part(results, known, drawn),
        _part("Replay", known, shown, replayed) if others else None,
        _part("Rehabilitation", {}, _of(drawn, "fig16_rehab", "fig17_rehab_errors"), [replays.modes_table(rehab)])
        if rehab is not None
        else None,
        Block("Appendix", folds=(again, Block("Files", tables=(files,)))),
    ]
    return [part for part in every if part is not None]


def _files(results: Results) -> list[tuple[Given[Any], str, str]]:
    """The files given to the report, what each is, and the command that makes it."""
    each: list[tuple[Sequence[Given[Any]], str, Callable[[Any], str]]] = [
        (results.data, "ingest", lambda one: f"data, {EXPERIMENT_NAMES[one.kind]}"),
        (results.fits, "fit", lambda one: f"fit, {EXPERIMENT_NAMES[one.data.kind]}"),
        (results.gains, "tune-rc", lambda _: "gains"),
        (results.replays, "simulate", lambda one: f"replay, {one.head.scenario}"),
        (results.couplings, "couple", lambda _: "virtual walls"), (results.rigs, "sessions", lambda _: "rig"),
        (results.comparisons, "compare", lambda _: "comparison"),
    ]  # fmt: skip
    return [(one, said(one.result), command) for some, command, said in each for one in some if not one.of_fit]


def _of(drawn: Figures, *names: str) -> tuple[PageFigure, ...]:
    """Figures by name, but for those that a part before has shown."""
    return tuple(drawn.pop(name) for name in names if name in drawn)


def _block(
    title: str, figures: Sequence[PageFigure], tables: Iterable[Table], findings: Sequence[tuple[str, str]] = ()
) -> list[Block]:
    """Figures, tables that have rows and findings under one title; none where there is nothing."""
    block = Block(title, tuple(figures), tuple(table for table in tables if table.rows), tuple(findings))
    return [block] if block.count else []


def _sentences(findings: Iterable[Finding], of_data: bool) -> tuple[tuple[str, str], ...]:
    """Severity and sentence of each."""
    return tuple((found.severity, sentence(found, of_data)) for found in findings)


def _found_beside(results: Results, given: Given[Any], kind: str) -> tuple[tuple[str, str], ...]:
    """What was found of data or a fit that the page is not about: it stands in a fold of its own. What was found of the
    data of another kind stands with its first fit."""
    if isinstance(given.result, Fit):
        first = given.result is results.fit(kind)
        results = replace(results, fits=(given,), data=results.data if first else ())
    elif kind == results.main_kind or results.fit(kind) is not None:
        return ()
    known = summary.known_findings(results, kind)
    return _sentences(known["data"], True) + _sentences(known["model"], False)


def _part(
    title: str, known: ByPart, figures: Sequence[PageFigure], tables: Iterable[Table], folds: Sequence[Block] = (),
    open_figures: int = 1,
) -> Block:  # fmt: skip
    """A part with its first figures, its gravest findings and its first table; what else there is stands folded."""
    findings = _sentences(known.get(title.lower(), ()), title == "Data")
    more = [Block("More to know", findings=findings[MOST_TOLD:])] if len(findings) > MOST_TOLD else []
    rows = [table for table in tables if table.rows]
    shown = [table for table in rows[:1] if len(table.rows) <= OPEN_ROWS]
    more += _block(f"More on the {title.lower()}", figures[open_figures:], rows[len(shown) :])
    return Block(title, tuple(figures[:open_figures]), tuple(shown), findings[:MOST_TOLD], folds=(*more, *folds))


def _sessions_part(results: Results, known: ByPart, drawn: Figures) -> Block | None:
    tables = [sessions.scatter_table(given.result) for given in results.rigs]
    tables += [sessions.changes_table(given.result) for given in results.comparisons]
    figures = _of(drawn, "sessions_chart", "sessions_compared")
    found = _part("Sessions", known, figures, tables, open_figures=2)
    return found if found.figures or found.tables or found.findings else None


def _data_part(results: Results, known: ByPart, drawn: Figures) -> Block | None:
    if not results.data and not known["data"]:
        return None
    of_main_kind = (given.result for given in results.data if given.result.kind == results.main_kind)
    main = results.main_data or next(of_main_kind, None)
    tables: list[Table] = []
    folds: list[Block] = []
    for given in results.data:
        steps = given.result
        every = [data.levels_recorded(steps), data.slips_table(steps), data.runs_table(steps)]
        if steps is main:
            tables = every
        else:
            found = _found_beside(results, given, steps.kind)
            folds += _block(f"{EXPERIMENT_NAMES[steps.kind].capitalize()}: every run", (), every, found)
    alone = () if results.fits else ("fig07_nonlinear_model", "fig03_friction_steps")
    figures = _of(drawn, *alone, "fig06_hold_and_release", "fig02_pwm")
    return _part("Data", known, figures, tables, folds, max(1, len(figures) - 1))


def _model_part(results: Results, known: ByPart, drawn: Figures) -> Block | None:
    kind = results.main_kind
    if not results.fits or kind is None:
        return None
    main, kinds = results.fit(kind), [given.result.data.kind for given in results.fits]
    figures = _of(drawn, *KIND_FIGURES[kind])
    folds: list[Block] = []
    for given in sorted(results.fits, key=lambda given: [*EXPERIMENT_NAMES].index(given.result.data.kind)):
        if given.result is not main:
            of = given.result.data.kind
            title = EXPERIMENT_NAMES[of].capitalize() + (f", {given.path}" if kinds.count(of) > 1 else "")
            found = _found_beside(results, given, of)
            folds += _block(title, _of(drawn, *KIND_FIGURES[of]), fits.model_tables(given.result), found)
    tables = fits.model_tables(main) if main is not None else []
    return _part("Model", known, figures, tables, folds, 4)


def _controller_part(results: Results, known: ByPart, drawn: Figures) -> Block | None:
    tables, folds = [gains.walls_table(given.result) for given in results.couplings], []
    for k, given in enumerate(results.gains):
        controllers, checklist, *others = gains.tables_of(given.result)
        if k:
            folds += _block(f"Gains of {given.path}", (), [controllers, checklist, *others])
        else:
            tables = [checklist, *tables, controllers, *others]
    figures = _of(drawn, "fig13_sweep")
    return _part("Controller", known, figures, tables, folds) if results.gains or figures or tables else None


AS_RECORDED = "Take peak, slip and held output as recorded (below): no plan mends what decays"
# Condition of the guarantee → the option by which tune-rc meets it
MENDED = {"rho": "--b-hat minimax", "phi": "--phi data", "Q_M": "--reference multisine"}


def next_steps(results: Results) -> list[tuple[str, str]]:
    """At most three things to do, each with the command that does it, wherever it is pasted."""
    clutch = next((fit for fit in results.fits if fit.result.data.kind == "clutch"), None)
    fit = clutch or next(iter(results.fits), None)
    if fit is None and (of_sessions := _next_of_sessions(results)):
        return of_sessions
    if fit is None:
        return [("Fit the data", _line("fit", one, "-o", _unused(one, "fit.json"))) for one in results.data[:1]]
    usable, linear, told = fit.result.verdict.usable, fit.result.linear, {one.code for one in fit.result.findings}
    first, refit = advised(fit.result.findings, fit.result.command)
    decays = "output-decays-under-hold" in told
    steps = [(why[:1].upper() + why[1:], "") for why in (first, AS_RECORDED * decays) if why]
    if refit and fit.result.command:
        steps.append(("Fit again as the runs ask", _line("fit", *_typed(fit), *refit.split(), "-o", fit, "--force")))
    if linear is not None and not results.gains and usable and linear.a0 > 0 and linear.b0 > 0:
        steps.append(("Design the controllers", _line("tune-rc", fit, "-o", _unused(fit, "gains.json"))))
    given = next(iter(results.gains), None) if usable else None
    conditions = gains.conditions_of(given.result) if given is not None else ()
    if given is not None:
        missing = [row for row in conditions if row.holds is False]
        options = " ".join(MENDED[row.name] for row in missing if row.name in MENDED).split()
        if options and not any(row.name in gains.BEYOND_GAINS for row in missing):
            why = f"Ask for gains whose guarantee holds ({', '.join(map(gains.called, missing))})"
            line = _line("tune-rc", *(_typed(given) or [fit]), *options, "-o", given, "--force")
            steps.append((why, line))  # what was asked for stays
        if results.replay("multisine") is None:
            line = _line("simulate", fit, given, "--scenario", "multisine", "-o", _unused(fit, "multisine.h5"))
            steps.append(("Try the controllers on the fitted model", line))
    # of other kinds nothing is planned, and what decays under hold no plan mends
    planned = (fit.result.plant_ is None or fit.result.plant_.kind == "parallel") and not (
        decays or refit or "rise-of-the-rig" in told
    )
    if planned and (fit.result.nonlinear is not None or fit.result.friction_levels):
        logs = ["--excitation"] if fit.result.recorded is not None else []
        why = "Plan the next recordings, for narrower intervals"
        steps.append((why, _line("plan", fit, *logs, "-o", _unused(fit, "plan.csv"))))
    if given is not None and "rise-of-the-rig" not in told and (laws := offered(given.result, fit.result)) != ():
        without = "" if given.result.guarantee else ", without a guarantee"
        only = ["--law", ",".join(laws)] if laws else []
        line = _line("export", given, "--as", "c", *only, "-o", _unused(given, "rig"))
        steps.append((f"Take these gains to the rig{without}", line))
    unsaved = [f'{one.path}.save("{one.path}.json")' for one in (fit, given) if one is not None and not one.sha256]
    first = f" (first {', '.join(unsaved)})" if unsaved else ""
    return [(why + first, line) for why, line in steps[:3]]


def _whole(name: str | Path) -> str:
    """A file by its whole path, so that a command finds it from any folder."""
    return str(Path(name).absolute())


def _typed(one: Given[Any]) -> list[Any]:
    """The words that a result was asked for with, its files by their whole paths."""
    return [_whole(word) if os.path.exists(word) else word for word in one.result.command]  # any length of a word


def _unused(beside: Given[Any], name: str) -> str:
    """A new file or folder beside a given one: plan.csv, where there is one plan-2.csv."""
    first = Path(beside.path).absolute().with_name(name)
    others = (first.with_stem(f"{first.stem}-{k}") for k in itertools.count(2))
    return str(next(one for one in itertools.chain([first], others) if not one.exists()))


def _line(command: str, *words: str | Given[Any]) -> str:
    """A command line; a result that is in memory stands as the file that it is to be saved as."""
    named = (word if isinstance(word, str) else _whole(word.path + ".json" * (not word.sha256)) for word in words)
    return shlex.join(["eaid", command, *named])


def _next_of_sessions(results: Results) -> list[tuple[str, str]]:
    """What to do after a comparison or with a rig."""
    steps = [_after(given.result) for given in results.comparisons]
    for given in (given for given in results.rigs if given.result.base is not None):
        line = _line("today", given, "STEP", "-o", _unused(given, "today.json"))
        steps.append((f"Record {given.result.advice}", "" if given.result.confounded else line))
    return steps


def _after(found: Comparison) -> tuple[str, str]:
    """What to do after one comparison."""
    if found.promise is not None:
        kept, missed = "Keep the gains: the loop does what was promised", "Record and fit steps of the rig as it is now"
        return kept if found.promise.kept else missed, ""
    if found.tune_anew:
        file = _whole(found.in_question)
        return "Make gains for the session as it is now", _line("tune-rc", file) if os.path.exists(file) else ""
    if found.tune_anew is None:
        return "Record a reference step, which tells whether the gains still fit", ""
    return "Keep the gains; one reference step at the start of each session tells whether they still fit", ""


def commands(results: Results) -> list[str]:
    """Command lines that make these files again; a result of the Python API says so."""
    lines, files = [], _files(results)
    for one, _what, command in files:
        words = ("LOGS",) if command == "ingest" else getattr(one.result, "head", one.result).command
        line = shlex.join(["eaid", command, *words, "-o", one.path])
        lines.append(line if words else f"{one.path}: made in Python by eaid.{command.replace('-', '_')}")
    return [*lines, shlex.join(["eaid", "report", *(one.path for one, *_ in files), "-o", "report"])]


WORDS = {"good": "Good", "care": "Warning", "bad": "Stop", "none": "–"}


def page(results: Results, drawn: Sequence[PageFigure], pictures: Sequence[PageFigure]) -> str:
    """The whole page as text."""
    library = live.script() if any(one.live for one in drawn) else ""
    starter = _asset("page.js")
    made = Environment(
        loader=PackageLoader("eaid.report.page"), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    made.filters["sign"] = signs
    return made.get_template("report.html.j2").render(
        words=WORDS, grades=GRADES, called=WORD, shown=cell_text,
        title=summary.title(results),
        synthetic=results.synthetic,
        chips=summary.chips(results),
        mark=summary.mark_of(results),
        version=__version__,
        lights=summary.lights(results),
        pictures=pictures,
        numbers=summary.tables(results),
        next_steps=next_steps(results),
        parts=parts(results, {one.name: one for one in drawn}),
        # counted from 1 down the page; those of the paper's rig have its numbers
        counter=None if results.of_paper else itertools.count(1),
        style=Markup(_asset("page.css")),
        # Our own scripts only, told by their hash: nothing else on the page can run, whatever a file name says.
        allowed=" ".join(
            f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"
            for script in (library, starter) if script
        ),
        library=Markup(library),
        starter=Markup(starter),
    )  # fmt: skip


def signs(said: str) -> Markup:
    """Our own texts as HTML: T_s, u^2 and e^(…) get their sub- and superscripts, numbers a true minus sign, the ends of
    an interval stay on one line; names that users chose stand as they are."""
    safe = str(escape(str(said)))
    if isinstance(said, Name):
        return Markup(safe)
    safe = re.sub(r"(?<![^\s(\[])-(?=\.?\d)|(?<=\de)-(?=\d)", "−", safe).replace(" … ", "\u00a0…\u00a0")
    safe = re.sub(r"\^\(([^()]*)\)", r"<sup>\1</sup>", safe)
    safe = re.sub(r"(?<=[u%A-Za-z])\^(\d)", r"<sup>\1</sup>", safe)
    return Markup(re.sub(r"\b([TCBKQabc])_([A-Za-z0-9])\b", r"\1<sub>\2</sub>", safe))


def _asset(name: str) -> str:
    return (resources.files("eaid.report.page") / "templates" / name).read_text(encoding="utf-8")
