"""The parts of the page after the first screen: a picture first, one table, and the rest folded with a count."""

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from eaid.report.draw import Drawn
from eaid.report.page.glossary import Terms
from eaid.report.page.known import MOST, Known, sentence
from eaid.report.page.next_steps import commands
from eaid.report.results import KINDS, Results
from eaid.report.tables import checks, data, gains, recorded, replays
from eaid.report.tables.table import Table, listed

DOUBTFUL = 12
"""Doubtful runs that are shown; the rest are folded."""
OPEN_ROWS = 24
"""Most rows of a table that stands open; a longer one stands folded, whole, beside some of its rows."""
OPEN_FIGURES = 3
"""Figures of the page's own kind that stand open."""
KIND_FIGURES = {
    "clutch": ("recorded_logs", "bode", "fig07_nonlinear_model", "level_steps", "steps_over_level", "model_over_duty",
               "residuals_nonlinear", "fig08_linear_model", "residuals_linear", "fig09_shear_per_field"),
    "friction-force": ("level_steps", "steps_over_level", "fig04_friction_over_stress", "residuals_friction_force"),
    "friction-speed": ("level_steps", "steps_over_level", "fig05_friction_over_speed", "residuals_friction_speed"),
}  # fmt: skip
Figures = Mapping[str, Drawn]


@dataclass(frozen=True)
class Block:
    """A part of the page, or what stands closed in it under a line that counts and names it."""

    title: str
    figures: tuple[Drawn, ...] = ()
    tables: tuple[Table, ...] = ()
    findings: tuple[tuple[str, str], ...] = ()
    """Severity and sentence of each."""
    lines: tuple[str, ...] = ()
    """Command lines."""
    verdict: tuple[str, str] | None = None
    """Grade and words of a verdict that heads it."""
    folds: "tuple[Block, ...]" = ()
    terms: tuple[tuple[str, str], ...] = ()
    """Words that appear here first, with their meaning."""

    @property
    def id(self) -> str:
        """Where links lead."""
        return self.title.lower()

    @property
    def count(self) -> str:
        """How much there is."""
        parts = ((len(self.figures), "figure"), (len(self.tables), "table"), (len(self.findings), "finding"))
        return " and ".join(f"{n} {word}{'s' if n > 1 else ''}" for n, word in parts if n)

    @property
    def rows(self) -> int:
        """Rows of its tables."""
        return sum(len(table.rows) for table in self.tables)

    @property
    def names(self) -> str:
        """What there is, by name."""
        return listed([one.title.split(" · ")[-1] for one in self.figures] + [one.heading for one in self.tables])

    @property
    def texts(self) -> Iterable[str]:
        """What is read in it, without its folds."""
        yield from (said for _, said in self.findings)
        yield from (f"{one.title} {one.sees}" for one in self.figures)
        for one in self.tables:
            yield f"{one.heading} {one.caption} {' '.join(one.heads)} {' '.join(row[0] for row in one.texts)}"


def parts(results: Results, known: Known, drawn: Figures, terms: Terms) -> list[Block]:
    """The parts that have anything to show, in the order of the page, their words explained where they come first."""
    found = [
        _data(results, known, drawn), _model(results, known, drawn), _controller(results, known, drawn),
        _replay(results, known, drawn), _rehabilitation(results, drawn), _appendix(results),
    ]  # fmt: skip
    explained = []
    for part in found:
        if part is not None:
            first = terms.first_in(part.texts)
            folds = tuple(replace(fold, terms=terms.first_in(fold.texts)) for fold in part.folds)
            explained.append(replace(part, folds=folds, terms=first))
    return explained


def _of(drawn: Figures, *names: str) -> tuple[Drawn, ...]:
    return tuple(drawn[name] for name in names if name in drawn)


def _block(title: str, figures: Sequence[Drawn] = (), tables: Iterable[Table] = ()) -> list[Block]:
    """Figures and tables that have rows under one title; none where there are neither."""
    one = Block(title, tuple(figures), tuple(table for table in tables if table.rows))
    return [one] if one.figures or one.tables else []


def _part(
    title: str, known: Known, figures: Sequence[Drawn], tables: Iterable[Table], folds: Sequence[Block],
    besides: Container[str] = (),
) -> Block:  # fmt: skip
    """A part with its gravest findings, those about `besides` left out, the others and long tables folded."""
    told = [
        (one.severity, sentence(one, title == "Data")) for one in known[title.lower()] if one.subject not in besides
    ]
    more = [Block("More to know", findings=tuple(told[MOST:]))] if len(told) > MOST else []
    shown, whole = opened(tables)
    return Block(title, tuple(figures), shown, tuple(told[:MOST]), folds=(*whole, *more, *folds))


def opened(tables: Iterable[Table]) -> tuple[tuple[Table, ...], tuple[Block, ...]]:
    """Tables that stand open, and the long ones among them whole, folded; those without rows are left out."""
    shown, folds = [], []
    for table in tables:
        count = len(table.rows)
        if count > OPEN_ROWS:
            folds.append(Block(f"{table.heading}, whole", tables=(table,)))
            some = tuple(table.rows[round(k * (count - 1) / (OPEN_ROWS - 1))] for k in range(OPEN_ROWS))
            said = f"{table.caption} {OPEN_ROWS} of {count} rows; all of them are folded below."
            table = replace(table, caption=said, rows=some)
        if count:
            shown.append(table)
    return tuple(shown), tuple(folds)


def _data(results: Results, known: Known, drawn: Figures) -> Block | None:
    if not results.data and not known["data"]:
        return None
    of_kind = (one.result for one in results.data if one.result.kind == results.main_kind)
    own = results.main_data or next(of_kind, None)
    tables: list[Table] = []
    folds: list[Block] = []
    for one in results.data:
        doubtful, fine = data.runs_tables(one.result)
        levels, slips = data.levels_recorded(one.result), data.slips_table(one.result.runs, one.result)
        of = f"{KINDS[one.result.kind]}: every run" if len(results.data) > 1 else "every run"
        if one.result is own:
            first, rest = _parted(doubtful)
            tables = [first if first.rows else levels]
            more = [rest, levels] if first.rows else []
        else:
            more = [doubtful, levels]
        folds += _block(of.capitalize(), (), [*more, slips, fine])
    if results.edge_logs and not any(table.rows for table in tables):
        tables = [recorded.edges_table(results.edge_logs)]
    alone = () if results.fits else ("fig07_nonlinear_model", "fig03_friction_steps")
    figures = _of(drawn, *alone, "edges", "fig06_hold_and_release")
    folds += _block("How the clutch is driven", _of(drawn, "fig02_pwm"))
    return _part("Data", known, figures, tables, folds, {run.name for one in results.data for run in one.result.runs})


def _parted(table: Table) -> tuple[Table, Table]:
    """The first rows of a table, and the others under a heading of their own."""
    more = len(table.rows) - DOUBTFUL
    said = f"{table.caption} {more} more are folded below." if more > 0 else table.caption
    heading = f"More {table.heading[:1].lower()}{table.heading[1:]}"
    first = replace(table, caption=said, rows=table.rows[:DOUBTFUL])
    return first, replace(table, heading=heading, rows=table.rows[DOUBTFUL:])


def _figures_of(kind: str, drawn: Figures, results: Results) -> tuple[Drawn, ...]:
    shows_steps = "friction-force" if results.data_of("friction-force") is not None else "friction-speed"
    own = results.main_kind == kind
    names = (("fig03_friction_steps",) if kind == shows_steps else ()) + KIND_FIGURES[kind]
    return _of(drawn, *(name for name in names if own or "level" not in name))


def _model(results: Results, known: Known, drawn: Figures) -> Block | None:
    kind = results.main_kind
    if not results.fits or kind is None:
        return None
    figures = _figures_of(kind, drawn, results)
    own, pair = results.fit(kind), results.pair
    tables: list[Table] = []
    folds: list[Block] = []
    if pair is not None:  # then the comparison is the one table that stands open
        tables = [checks.comparison_table(pair[0].result, pair[1].result, (pair[0].path, pair[1].path))]
    for one in results.fits:
        fit, of = one.result, one.result.data.kind
        every = [*checks.model_tables(fit, results.paper), *checks.judging_tables(fit)]
        if fit is own:
            if pair is None:
                tables, every = every[:1], every[1:]
            folds += _block("More on the model", figures[OPEN_FIGURES:], every)
        else:
            several = sum(other.result.data.kind == of for other in results.fits) > 1
            called = f"{KINDS[of].capitalize()}, {one.path}" if several else KINDS[of].capitalize()
            folds += _block(called, _figures_of(of, drawn, results) if of != kind else (), every)
    return _part("Model", known, (*_of(drawn, "compare"), *figures[:OPEN_FIGURES]), tables, folds)


def _controller(results: Results, known: Known, drawn: Figures) -> Block | None:
    figures = _of(drawn, "guarantee_in_replay", "input_gain", "walls")
    stiff = [table for one in results.couplings for table in gains.walls_tables(one.result)]
    if not results.gains:
        return _part("Controller", known, figures, stiff, ()) if figures or stiff else None
    folds = []
    for k, one in enumerate(results.gains):
        title = f"Gains and margins, {one.path}" if k else "Gains and margins"
        beside = [gains.checklist(one.result)] if k else []
        every = [
            gains.table_iv(one.result, results.paper),
            gains.gains_table(one.result, results.paper),
            gains.search_table(one.result),
        ]
        folds += _block(title, (), [*beside, *every, *gains.further_tables(one.result)])
    judged = results.gains[0].result
    holds = judged.guarantee.holds if judged.guarantee is not None else None
    part = _part("Controller", known, figures, [gains.checklist(judged), *stiff], folds)
    return replace(part, verdict=("good" if holds else "care", f"Guarantee: {gains.guarantee_words(judged)}."))


def _replay(results: Results, known: Known, drawn: Figures) -> Block | None:
    shown = [one for one in results.replays if one.result.head.scenario != "rehab"]
    if not shown:
        return None
    own = [one for one in shown if one.result.head.scenario != "log"]
    logs = [replays.log_table(one.result) for one in shown if one.result.head.scenario == "log"]
    figures = _of(drawn, "fig12_multisine", "own_reference", "fig11_steps", "fig13_sweep", "log_replay")
    more = list(logs) if own else []
    for one in own:
        more += replays.further_tables(one.result)
    tables = [replays.errors_table([one.result for one in own])] if own else logs
    return _part("Replay", known, figures[:1], tables, _block("More replays", figures[1:], more))


def _rehabilitation(results: Results, drawn: Figures) -> Block | None:
    found = results.replay("rehab")
    if found is None:
        return None
    tables = replays.rehab_tables(found)
    folds = _block("Errors by mode, and whether they differ", _of(drawn, "fig17_rehab_errors"), tables[1:])
    return Block("Rehabilitation", _of(drawn, "fig16_rehab"), tuple(tables[:1]), folds=tuple(folds))


def _appendix(results: Results) -> Block:
    again = Block("How to do it again", lines=tuple(commands(results)))
    return Block("Appendix", folds=(again, Block("Files", tables=(data.files_table(results),))))
