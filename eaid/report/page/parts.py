"""The parts of the page after the first screen: a picture first, one table, and the rest folded with a count."""

from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass, replace

from eaid.report.page.again import commands
from eaid.report.page.glossary import Terms
from eaid.report.page.known import MOST, Known, sentence
from eaid.report.page.shown import Shown
from eaid.report.page.summary import guarantee_words
from eaid.report.ready_fits import main_kind
from eaid.report.results import KINDS, Given, Results
from eaid.report.tables import checks, data, fits, gains, recorded, replays
from eaid.report.tables.table import Table, listed
from eaid.results.fit import Fit


@dataclass(frozen=True)
class Fold:
    """Figures and tables that stand closed under a line that counts and names them."""

    title: str
    figures: tuple[Shown, ...] = ()
    tables: tuple[Table, ...] = ()
    texts: tuple[str, ...] = ()
    lines: tuple[str, ...] = ()
    terms: tuple[tuple[str, str], ...] = ()

    @property
    def count(self) -> str:
        """How much is folded."""
        parts = ((len(self.figures), "figure"), (len(self.tables), "table"), (len(self.texts), "finding"))
        return " and ".join(f"{n} {word}{'s' if n > 1 else ''}" for n, word in parts if n)

    @property
    def rows(self) -> int:
        """Rows of its tables."""
        return sum(len(table.rows) for table in self.tables)


@dataclass(frozen=True)
class Part:
    """A part of the page."""

    id: str
    title: str
    findings: tuple[tuple[str, str], ...] = ()
    """Severity and sentence of the gravest findings."""
    figures: tuple[Shown, ...] = ()
    tables: tuple[Table, ...] = ()
    folds: tuple[Fold, ...] = ()
    verdict: tuple[str, str] | None = None
    """Grade and words of a verdict that heads the part."""
    terms: tuple[tuple[str, str], ...] = ()


def parts(results: Results, known: Known, drawn: dict[str, Shown], asked: bool | None, terms: Terms) -> list[Part]:
    """The parts that have anything to show, in the order of the page."""
    found = [
        _data(results, known, drawn), _model(results, known, drawn, asked), _controller(results, known, drawn, asked),
        _replay(results, known, drawn), _rehabilitation(results, drawn), _appendix(results),
    ]  # fmt: skip
    return [_explained(part, terms) for part in found if part is not None]


def _explained(part: Part, terms: Terms) -> Part:
    """A part whose words are explained where they first appear."""
    first = terms.first_in((*(said for _, said in part.findings), *_texts(part.figures, part.tables)))
    folds = []
    for fold in part.folds:
        new = terms.first_in((*fold.texts, *_texts(fold.figures, fold.tables)))
        folds.append(replace(fold, terms=new))
    return replace(part, folds=tuple(folds), terms=first)


def _texts(figures: Sequence[Shown], tables: Sequence[Table]) -> Iterable[str]:
    for figure in figures:
        yield f"{figure.title} {figure.sees}"
    for table in tables:
        yield f"{table.heading} {table.caption} {' '.join(table.heads)} {' '.join(row[0] for row in table.texts)}"


def _few(found: Sequence[Table | None]) -> tuple[Table, ...]:
    return tuple(one for one in found if one is not None and one.rows)


def _fold(title: str, drawn: dict[str, Shown], names: Sequence[str], found: Sequence[Table] = ()) -> tuple[Fold, ...]:
    figures, given = tuple(drawn[name] for name in names if name in drawn), _few(found)
    return (Fold(title, figures, given),) if figures or given else ()


def _told(
    known: Known, part: str, besides: Container[str] = ()
) -> tuple[tuple[tuple[str, str], ...], tuple[Fold, ...]]:
    """The gravest findings of a part, and a fold of the rest; those about `besides` stand elsewhere."""
    found = [one for one in known.of(part) if one.subject not in besides]
    first = tuple((one.severity, sentence(one, part == "data")) for one in found[:MOST])
    rest = tuple(sentence(one, part == "data") for one in found[MOST:])
    return first, (Fold("More to know", texts=rest),) if rest else ()


def _data(results: Results, known: Known, drawn: dict[str, Shown]) -> Part | None:
    if not results.data and not known.of("data"):
        return None
    first, rest = _told(known, "data", {run.name for one in results.data for run in one.result.runs})
    kind = main_kind(results)
    own = results.data_of(kind) if kind else None
    tables: list[Table] = []
    folds = [*rest]
    for one in results.data:
        doubtful, fine = data.runs_tables(one.result)
        of = KINDS[one.result.kind] if len(results.data) > 1 else ""
        if one.result is own:
            tables += [first_rows(doubtful) if doubtful.rows else data.levels_recorded(one.result)]
            more = [rest_rows(doubtful), data.levels_recorded(one.result)] if doubtful.rows else []
        else:
            more = [doubtful, data.levels_recorded(one.result)]
        more.append(data.slips_table(one.result))
        folds += _fold(f"{of}: every run".lstrip(": ").capitalize(), drawn, (), [*more, fine])
    alone = () if results.fits else ("fig07_nonlinear_model", "fig03_friction_steps")
    names = (*alone, "fig06_hold_and_release")
    figures = tuple(drawn[name] for name in names if name in drawn)
    folds += _fold("How the clutch is driven", drawn, ("fig02_pwm",))
    shown, whole = opened(_few(tables))
    return Part("data", "Data", first, figures, shown, (*whole, *folds))


DOUBTFUL = 12
"""Doubtful runs that are shown; the rest are folded."""


OPEN_ROWS = 24
"""Most rows of a table that stands open; a longer one stands folded, whole, beside some of its rows."""


def first_rows(table: Table) -> Table:
    """The first rows of a table."""
    more = len(table.rows) - DOUBTFUL
    said = f" {more} more are folded below." if more > 0 else ""
    return replace(table, caption=f"{table.caption}{said}", rows=table.rows[:DOUBTFUL])


def rest_rows(table: Table) -> Table:
    """The other rows."""
    return replace(table, heading=f"More {table.heading[:1].lower()}{table.heading[1:]}", rows=table.rows[DOUBTFUL:])


def opened(tables: Sequence[Table]) -> tuple[tuple[Table, ...], tuple[Fold, ...]]:
    """Tables to stand open, and the long ones among them whole, folded."""
    shown, folds = [], []
    for table in tables:
        count = len(table.rows)
        if count <= OPEN_ROWS:
            shown.append(table)
            continue
        some = tuple(table.rows[round(k * (count - 1) / (OPEN_ROWS - 1))] for k in range(OPEN_ROWS))
        said = f"{table.caption} {OPEN_ROWS} of {count} rows; all of them are folded below."
        shown.append(replace(table, caption=said, rows=some))
        folds.append(Fold(f"{table.heading}, whole", tables=(table,)))
    return tuple(shown), tuple(folds)


_KIND_FIGURES = {
    "clutch": ("recorded_logs", "fig07_nonlinear_model", "level_steps", "steps_over_level",
               "model_over_duty", "bode",
               "residuals_nonlinear", "fig08_linear_model", "residuals_linear", "fig09_shear_per_field"),
    "friction-force": ("level_steps", "steps_over_level", "fig04_friction_over_stress", "residuals_friction_force"),
    "friction-speed": ("level_steps", "steps_over_level", "fig05_friction_over_speed", "residuals_friction_speed"),
}  # fmt: skip
OPEN = 3
"""Figures of the page's own kind that stand open."""


def _figures_of(kind: str, drawn: dict[str, Shown], results: Results) -> list[Shown]:
    shows_steps = "friction-force" if results.data_of("friction-force") is not None else "friction-speed"
    names = (("fig03_friction_steps",) if kind == shows_steps else ()) + _KIND_FIGURES[kind]
    own = main_kind(results) == kind
    return [drawn[name] for name in names if name in drawn and (own or "level" not in name)]


def _model(results: Results, known: Known, drawn: dict[str, Shown], asked: bool | None) -> Part | None:
    if not results.fits:
        return None
    first, rest = _told(known, "model")
    kind = main_kind(results)
    assert kind is not None
    figures = _figures_of(kind, drawn, results)
    tables: list[Table] = []
    folds = [*rest]
    own = results.fit(kind)
    if results.pair is not None:
        tables.append(checks.comparison_table(results.pair[0].result, results.pair[1].result,
                                              (results.pair[0].path, results.pair[1].path)))  # fmt: skip
    for one in results.fits:
        everything = list(_few(_tables_of(one.result, asked)))
        if one.result is own:
            if results.pair is None:  # else the comparison is the one that stands open
                tables, everything = everything[:1], everything[1:]
            folds += [Fold("More on the model", tuple(figures[OPEN:]), tuple(everything))]
        else:
            beside = _figures_of(one.result.data.kind, drawn, results) if one.result.data.kind != kind else []
            folds.append(Fold(_called(results, one), tuple(beside), tuple(everything)))
    shown = ([drawn["compare"]] if "compare" in drawn else []) + figures[:OPEN]
    kept = tuple(fold for fold in folds if fold.count)
    few, whole = opened(tables)
    return Part("model", "Model", first, tuple(shown), few, (*whole, *kept))


def _called(results: Results, fit: Given[Fit]) -> str:
    """What a fit is called in headings: its kind, and its file where there are several of that kind."""
    kind = KINDS[fit.result.data.kind].capitalize()
    several = sum(1 for other in results.fits if other.result.data.kind == fit.result.data.kind) > 1
    return f"{kind}, {fit.path}" if several else kind


def _tables_of(fit: Fit, asked: bool | None) -> list[Table]:
    """Every table of a fit, the single levels first."""
    found = recorded.recorded_tables(fit)
    if fit.friction is not None:
        found.append(fits.levels_table(fit))
        if fit.data.kind != "clutch":
            found.append(fits.trends_table(fit, asked))
    found.append(fits.level_steps_table(fit))
    if fit.nonlinear is not None:
        found += [fits.table_iii(fit, asked), checks.estimates_table(fit)]
    if fit.linear is not None:
        found += [fits.linear_table(fit, asked), fits.input_gain_table(fit, asked)]
    if fit.release is not None:
        found.append(fits.release_table(fit))
    found += [fits.held_out_table(fit), checks.lack_of_fit_table(fit), checks.shapes_table(fit)]
    return [*found, checks.degrees_table(fit), *fits.huber_tables(fit)]


def _controller(results: Results, known: Known, drawn: dict[str, Shown], asked: bool | None) -> Part | None:
    figures = tuple(drawn[name] for name in ("guarantee_in_replay", "input_gain", "walls") if name in drawn)
    stiff = [gains.walls_table(one.result) for one in results.couplings]
    if not results.gains:
        return Part("controller", "Controller", figures=figures, tables=_few(stiff)) if figures or stiff else None
    first, rest = _told(known, "controller")
    folds = [*rest]
    for k, one in enumerate(results.gains):
        title = "Gains and margins" if k == 0 else f"Gains and margins, {one.path}"
        everything = [gains.table_iv(one.result, asked), gains.gains_table(one.result, asked)]
        beside = [gains.checklist(one.result)] if k else []
        folds += _fold(title, {}, (), [*beside, *everything, gains.margins_table(one.result)])
    judged = results.gains[0].result
    holds = judged.guarantee.holds if judged.guarantee is not None else None
    words = f"Guarantee: {guarantee_words(judged)}."
    few, whole = opened(_few([gains.checklist(judged), *stiff]))
    verdict = "good" if holds else "care", words
    return Part("controller", "Controller", first, figures, few, (*whole, *folds), verdict)


def _replay(results: Results, known: Known, drawn: dict[str, Shown]) -> Part | None:
    shown = [one for one in results.replays if one.result.head.scenario != "rehab"]
    if not shown:
        return None
    first, rest = _told(known, "replay")
    own = [one for one in shown if one.result.head.scenario != "log"]
    logs = [one.result for one in shown if one.result.head.scenario == "log"]
    names = ["fig12_multisine", "own_reference", "fig11_steps", "fig13_sweep", "log_replay"]
    figures = [drawn[name] for name in names if name in drawn]
    main = [replays.replays_table(own)] if own else [replays.log_table(one) for one in logs]
    more = [replays.log_table(one) for one in logs] if own else []
    for one in own:
        more += [replays.plants_table(one.result), replays.steps_table(one.result), replays.tones_table(one.result)]
    fold = Fold("More replays", tuple(figures[1:]), _few(more))
    folds = (*rest, *((fold,) if fold.count else ()))
    few, whole = opened(_few(main))
    return Part("replay", "Replay", first, tuple(figures[:1]), few, (*whole, *folds))


def _rehabilitation(results: Results, drawn: dict[str, Shown]) -> Part | None:
    found = results.replay("rehab")
    if found is None:
        return None
    tables = replays.rehab_tables(found)
    figures = tuple(drawn[name] for name in ("fig16_rehab",) if name in drawn)
    folds = _fold("Errors by mode, and whether they differ", drawn, ("fig17_rehab_errors",), tables[1:])
    return Part("rehabilitation", "Rehabilitation", (), figures, tuple(tables[:1]), folds)


def _appendix(results: Results) -> Part:
    lines = Fold("How to do it again", lines=tuple(commands(results)))
    return Part("appendix", "Appendix", folds=(lines, Fold("Files", tables=(data.files_table(results),))))


def fold_names(fold: Fold) -> str:
    """What is in a fold, by name."""
    names = [one.title.split(" · ")[-1] for one in fold.figures] + [one.heading for one in fold.tables]
    return listed(names)
