"""The first screen: what the page is about, one story of data, model and controller, its pictures and numbers."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from eaid.errors import on_command_line
from eaid.findings import Finding
from eaid.report.figures import logs, replays, steps, values
from eaid.report.page.known import MOST, Known
from eaid.report.panels import Axis, Panel, Sheet
from eaid.report.results import KINDS, Results
from eaid.report.rig import controller_name, level_text, of_the_paper, rising
from eaid.report.tables import Cell, Table, columns, number
from eaid.report.tables.data import warnings_of
from eaid.report.tables.gains import guarantee_story
from eaid.report.tables.replays import SCENARIO_NAMES, metric
from eaid.results import summary
from eaid.results.fit import Fit
from eaid.results.replay import Replay
from eaid.shown import counted


def fit_pct(fit: Fit) -> float | None:
    """100 (1 − ‖y − ŷ‖/‖y − mean y‖) of the page's model, as the fit says: of all its data, else the levels' mean."""
    if fit.nonlinear is not None and fit.nonlinear.fit_pct is not None:
        return fit.nonlinear.fit_pct
    percents = [row.fit_pct for row in fit.friction_levels if row.fit_pct is not None]
    return float(np.mean(percents)) if percents else None


def tables(results: Results) -> tuple[Table, ...]:
    """The numbers of the first screen: values at three levels as the terminal has them; controllers side by side."""
    found = []
    if results.main_fit is not None and (cells := summary.values(results.main_fit)):
        heads = [head.replace("[", "(").replace("]", ")") for head in cells[0]]
        found.append(Table("Values with 95 % intervals", "", columns(*heads), tuple(map(tuple, cells[1:]))))
    return (*found, *_controllers(results))


def _controllers(results: Results) -> Iterator[Table]:
    """Errors in the replay shown, else in the one behind the gains, and least margins: each, and RC against PI."""
    replay, gains = _replay_of(results), results.gains[0].result if results.gains else None
    keys = {"max_abs_error_nm": "largest error", "rms_error_nm": "RMS error"}
    rows: dict[str, list[float | None]] = {}
    names = ["rc", "pi"]
    if replay is not None:
        names = [name for name in names if name in replay.records] or list(replay.records)[:2]
        unit, where = replay.head.output_unit, SCENARIO_NAMES.get(replay.head.scenario, replay.head.scenario)
        rows = {said: [metric(replay, name, key) for name in names] for key, said in keys.items()}
    elif gains is not None and (known := gains.replayed) is not None:
        unit, where = gains.output_unit, SCENARIO_NAMES.get(known.reference, known.reference)
        rows = {said: [getattr(getattr(known, name), key, None) for name in names] for key, said in keys.items()}
    rows = {f"{said} ({unit}), {where}" if unit else f"{said}, {where}": each for said, each in rows.items()}
    worst = gains.margins.worst if gains is not None and gains.margins is not None else None
    for key, said in (("gain_db", "least gain margin (dB)"), ("phase_deg", "least phase margin (°)")):
        if worst is not None and names == ["rc", "pi"]:
            rows[said] = [getattr(getattr(worst, name), key, None) for name in names]
    shown: list[tuple[Cell, ...]] = []
    for said, each in rows.items():
        cells = [f"{value:.3g}" if value is not None else None for value in each]
        first, last = each[0], each[-1]
        ratio = f"{last / first:.2g}" if "error" in said and first and last and len(each) == 2 else ""
        if any(cells):
            shown.append((said, *cells, *([ratio] if names == ["rc", "pi"] else [])))
    ratios = ["PI/RC"] if names == ["rc", "pi"] else []
    if shown:
        yield Table("Controllers", "", columns("", *map(controller_name, names), *ratios), tuple(shown))


GRADES = {"stop": "bad", "caution": "care", "note": "good"}


@dataclass(frozen=True)
class Light:
    """One thing at a glance: good, care (read first), bad (do not use) or none (not given), and where to look."""

    name: str
    grade: str
    text: str
    part: str


def title(results: Results) -> str:
    """What the page is about."""
    kind, fit = results.main_kind, results.main_fit
    data = fit.data if fit is not None else results.main_data
    what = "Electroadhesive clutch" if kind == "clutch" and of_the_paper(data) else "Step responses"
    if data is not None and kind != "clutch":
        what = KINDS[data.kind].capitalize()
    if kind is None:
        what = "Replays" if results.replays else "Gains"
    return what


def chips(results: Results) -> tuple[str, ...]:
    """Where the numbers come from: synthetic or a rig, what was stepped and measured, levels."""
    texts = ["synthetic data"] if results.synthetic else []
    fit, data = results.main_fit, results.main_data
    about = fit.data if fit is not None else data
    if about is not None:
        texts.append(f"{about.input_unit or 'level'} → {about.output_unit or 'output'}")
    levels = sorted(row.level for row in data.levels) if data is not None else sorted(fit.data.levels) if fit else []
    if fit is not None and fit.recorded is not None and fit.recorded.logs:
        logs = fit.recorded.logs
        texts.append(f"{counted(len(logs), 'log')} as recorded, {sum(log.duration_s for log in logs):.4g} s")
    if levels and about is not None:
        span = f"{levels[0]:.4g} to {level_text(levels[-1], about.input_unit)}"
        texts.append(f"{len(levels)} levels, {span}" if len(levels) > 1 else level_text(levels[0], about.input_unit))
    if len(results.kinds) > 1:
        texts.append("with " + " and ".join(KINDS[kind] for kind in results.kinds[1:]))
    return tuple(texts)


def lights(results: Results, known: Known) -> tuple[Light, Light, Light]:
    """Data, model and controller at a glance; by the severity of what was found, never by its words."""
    return _data(results, known), _model(results, known), _controller(results, known)


def _worst(grades: Iterable[str]) -> str:
    return min(grades, key=("bad", "care", "good").index, default="good")


def _grade(findings: Sequence[Finding]) -> str:
    return _worst(GRADES[found.severity] for found in findings)


def _counted(findings: Sequence[Finding], unit: str = "") -> str:
    """`2 warnings: repeats disagree at 60 %, τ2 open`; the gravest are named."""
    grave = [found for found in findings if found.severity != "note"]
    counts = Counter(found.severity for found in grave)
    kinds = ((counts["stop"], "stop"), (counts["caution"], "warning"))
    said = ", ".join(counted(count, word) for count, word in kinds if count)
    names = []
    for one in grave[:MOST]:
        at = f" at {level_text(one.levels[0], unit)}" if len(one.levels) == 1 else ""
        names.append(one.code.replace("-", " ").replace("tau", "τ") + at)
    return f"{said}: {', '.join(dict.fromkeys(names))}{', …' * (len(grave) > MOST)}" if grave else "no warning"


def _data(results: Results, known: Known) -> Light:
    data, fit, findings = results.main_data, results.main_fit, known["data"]
    if data is not None:
        warned = sum(1 for run in data.runs if warnings_of(run))
        text = (
            f"{warned} of {counted(len(data.runs), 'run')} warned; "
            if warned
            else f"{counted(len(data.runs), 'run')}; "
        )
        grade = _worst([_grade(findings), "care" if warned else "good"])
        return Light("Data", grade, text + _counted(findings, data.input_unit), "data")
    if fit is not None and fit.data.sources:
        text = f"{counted(len(rising(fit.data.sources)), 'run')}; {_counted(findings, fit.data.input_unit)}"
        return Light("Data", _grade(findings), text, "data")
    return Light("Data", "none", "no data given", "appendix")


def _model(results: Results, known: Known) -> Light:
    fit = results.main_fit
    if fit is None:
        return Light("Model", "none", "no fit given", "appendix")
    if not fit.verdict.usable:
        return Light("Model", "bad", on_command_line(f"NOT USABLE: {fit.verdict.sentence}"), "model")
    findings, percent = known["model"], fit_pct(fit)
    lead = "usable; " if percent is None else f"usable, fits {number(percent, 3)} % (100 % = perfect); "
    return Light("Model", _grade(findings), lead + _counted(findings, fit.data.input_unit), "model")


def _controller(results: Results, known: Known) -> Light:
    if not results.gains:
        return Light("Controller", "none", "no gains given", "controller" if results.fit("clutch") else "appendix")
    gains = results.gains[0].result
    grade = _grade(known["controller"])
    if grade == "good" and gains.guarantee is not None and gains.guarantee.holds is False:
        grade = "care"
    return Light("Controller", grade, guarantee_story(gains), "controller")


MARK = "Fit NOT USABLE: do not quote"


def mark_of(results: Results) -> tuple[str, list[str]] | None:
    """The mark, and why; None where no fit is given, and no gains or replays of one, that must not be used."""
    reasons = [one.result.verdict.sentence for one in results.fits]
    reasons += [one.result.not_usable or "" for one in results.gains]
    reasons += [why for replay in results.replays for why in replay.result.head.not_usable.values()]
    told = list(dict.fromkeys(on_command_line(why) for why in reasons if why))
    return (MARK, told) if told else None


SCENARIOS = ("multisine", "reference", "steps")  # Replays that are shown, the best first
WIDTH_IN, HEIGHT_IN = 5.0, 2.5
SHOWN_S = 20.0  # Most of a replay that is shown [s]


def pictures(results: Results) -> list[tuple[str, str, Sheet]]:
    """Title, part of the page where more of it stands, and picture: the first two that there are."""
    return list(islice(_candidates(results), 2))


def _replay_of(results: Results) -> Replay | None:
    """The replay that is shown."""
    return next(filter(None, map(results.replay, SCENARIOS)), None)


def _shares(fit: Fit) -> list[tuple[float, float]]:
    """Fit [%] and level, of the model that is drawn."""
    rows = fit.nonlinear.per_level if fit.nonlinear is not None else fit.friction_levels
    return [(row.fit_pct, row.level) for row in rows if row.fit_pct is not None]


def _picture(panels: Sequence[Panel], ratios: tuple[float, ...] = (), columns: int = 1) -> Sheet:
    return Sheet(panels, HEIGHT_IN, WIDTH_IN, columns, ratios, lettered=False)


def _candidates(results: Results) -> Iterator[tuple[str, str, Sheet]]:
    """Described when wanted, the best first.

    The model on its data, controllers, fitted values over the level, or a step with the curve that it asks for.
    """
    data, fit, replay = results.main_data, results.main_fit, _replay_of(results)
    drawn = logs.drawn_logs(fit.recorded.logs) if fit is not None and fit.recorded is not None else []
    if fit is not None and drawn:  # the input, and below it the output and the model driven by that input alone
        units = fit.data.input_unit, fit.data.output_unit
        yield "Measured against model", "model", _picture(logs.log_panels(drawn[-1].curve, units)[:2], (1, 2))
    elif data is not None:
        models = steps.nonlinear_curves(fit, data) or steps.single_curves(fit)
        panels = [steps.steps_panel(replace(data, levels=tuple(steps.some_of(data.levels, 6))), models)]
        worst = min(_shares(fit), default=None) if fit is not None and len(data.levels) > 1 else None
        alone = tuple(row for row in data.levels if worst is not None and row.level == worst[1])
        if alone and worst is not None:  # the level that the model follows least, on a scale of its own
            panel = steps.steps_panel(replace(data, levels=alone), models)
            bare = [replace(line, end="") for line in panel.lines]
            title = f"worst: {level_text(worst[1], data.input_unit)}, fit {number(worst[0], 3)} %"
            panels.append(replace(panel, y=Axis(), lines=bare, legend="", title=title))
        said, part = ("Measured against model", "model") if models else ("Measured", "data")
        widths = (1.6, 1) if len(panels) > 1 else ()
        yield said, part, replace(_picture(panels, columns=len(panels)), widths=widths, share=(False, False))
    if replay is not None:
        until = replays.counted_from(replay) + SHOWN_S
        panels = replays.tracking_panels(replay, until)[:2]
        yield "Controllers against the reference", "replay", _picture(panels, (1.6, 1))
    if fit is None:
        return
    if len(summary.believed_levels(fit)) > 1:
        yield "Fitted values over the level", "model", _picture(values.value_panels(fit), columns=3)
    for recorded in (given.result for given in results.data):
        if recorded.kind == fit.data.kind and steps.paired(recorded, fit.steps):
            panel = steps.level_steps_panel(recorded, fit.steps)
            yield "Steps, each by its own curve", "model", _picture([panel])
