"""The head of the page: what it is about, where the numbers come from, and three lights."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from eaid.findings import Finding
from eaid.report.figures import logs, replays, steps, values
from eaid.report.page.known import Known
from eaid.report.panels import Panel, Sheet
from eaid.report.results import KINDS, Results
from eaid.report.rig import controller_name, level_text, of_the_paper, rising
from eaid.report.tables import interval, number
from eaid.report.tables.data import warnings_of
from eaid.report.tables.gains import guarantee_words
from eaid.report.tables.replays import SCENARIO_NAMES, metric
from eaid.results.common import ci95_of
from eaid.results.fit import CurveLevel, Fit, FrictionLevel, StepShape
from eaid.results.summary import ENDLESS_S, believed_levels, steps_of_other_shapes
from eaid.shown import counted

MEANINGS = {"Ts": ("T_s", "steady output"), "tau1": ("τ1", "fast time constant"), "tau2": ("τ2", "slow time constant")}
"""Symbol and meaning of each value at a level."""


@dataclass(frozen=True)
class Tile:
    """One number of the first screen."""

    label: str
    value: str
    note: str


def fit_pct(results: Results) -> float | None:
    """100 (1 − ‖y − ŷ‖/‖y − mean y‖) of the page's model, as the fit says: of all its data, else the levels' mean."""
    fit = results.main_fit
    if fit is not None and fit.nonlinear is not None and fit.nonlinear.fit_pct is not None:
        return fit.nonlinear.fit_pct
    percents = [row.fit_pct for row in (fit.friction_levels if fit else ()) if row.fit_pct is not None]
    return float(np.mean(percents)) if percents else None


def tiles(results: Results) -> tuple[Tile, ...]:
    """Six numbers: fit, T_s, τ1, τ2 at the top level, largest errors, worst margin; none of edges alone."""
    if results.shows_edges:
        return ()
    percent = fit_pct(results)
    fit = Tile("fit", f"{number(percent, 3)} %" if percent is not None else "–", "100 % would be on the data")
    return (fit, *_values(results.main_fit), _errors(results), _margins(results))


def _values(fit: Fit | None) -> list[Tile]:
    """T_s, τ1 and τ2 at the top level, with what they are at two lower ones; those of a step that has another shape."""
    rows: Sequence[CurveLevel | FrictionLevel] = believed_levels(fit) if fit is not None else ()
    steps = steps_of_other_shapes(fit) if fit is not None else []
    if fit is None or not (rows or steps):
        return [Tile(label, "–", meaning) for label, meaning in MEANINGS.values()]
    if steps:
        top = max(steps, key=lambda step: step.level)
        return [_value(fit, name, top, dead_time_s=steps[0].dead_time_s) for name in MEANINGS]
    highest = max(rows, key=lambda row: row.level)
    lower = sorted((row for row in rows if row.level < highest.level), key=lambda row: row.level)
    lower = [lower[k] for k in sorted({0, (len(lower) + 1) // 2})] if len(lower) > 1 else lower
    return [_value(fit, name, highest, lower) for name in MEANINGS]


def _value(
    fit: Fit,
    name: str,
    top: CurveLevel | FrictionLevel | StepShape,
    lower: Sequence[CurveLevel | FrictionLevel] = (),
    dead_time_s: float = 0.0,
) -> Tile:
    """One value at the top level, its interval, what it means, and what it is at lower levels."""
    label, meaning = MEANINGS[name]
    unit = fit.data.output_unit if name == "Ts" else "s"
    key = "change" if isinstance(top, StepShape) and name == "Ts" else name
    value, ends = getattr(top, key), ci95_of(top, key)
    if name == "tau1" and dead_time_s:
        meaning += f", behind a dead time of {number(dead_time_s, 3)} s"
    note = f"{interval(ends)}, 95 %; {meaning}" if ends is not None else f"{meaning}; no interval"
    for row in lower:
        there = getattr(row, name)
        if there is not None and (name == "Ts" or there <= ENDLESS_S):
            note += f"; {number(there, 3)} at {level_text(row.level, fit.data.input_unit)}"
    text = "–" if value is None else f"{number(value, 3)} {unit}"
    if value is not None and name != "Ts" and ends is None and value > ENDLESS_S:
        text = "not estimable"
    return Tile(f"{label} at {level_text(top.level, fit.data.input_unit)}", text, note)


def _errors(results: Results) -> Tile:
    with_rc = (given.result for given in results.replays if "rc" in given.result.records)
    replay = results.replay("multisine") or next(with_rc, None)
    values, unit, where = {}, "", "no replay given"
    if replay is not None:
        values = {name: metric(replay, name, "max_abs_error_nm") for name in ("rc", "pi") if name in replay.records}
        scenario = replay.head.scenario
        unit, where = replay.head.output_unit, SCENARIO_NAMES.get(scenario, scenario)
    elif results.gains and (replayed := results.gains[0].result.replayed) is not None:
        errors = {"rc": replayed.rc, "pi": replayed.pi}
        values = {name: error.max_abs_error_nm for name, error in errors.items() if error is not None}
        unit, where = results.gains[0].result.output_unit, SCENARIO_NAMES.get(replayed.reference, replayed.reference)
    names = " | ".join(controller_name(name) for name in values) or "RC | PI"
    return Tile(
        f"largest error, {names}",
        " | ".join(number(v, 2) for v in values.values()) or "–",
        ", ".join(filter(None, (unit, where))),
    )


def _margins(results: Results) -> Tile:
    gains = results.gains[0].result if results.gains else None
    worst = gains.margins.worst if gains is not None and gains.margins is not None else None
    if worst is None:
        return Tile("worst margin, RC | PI", "–", "no gains given")
    loops = [loop for loop in (worst.rc, worst.pi) if loop is not None]
    phases = " | ".join("–" if loop.phase_deg is None else f"{loop.phase_deg:.0f}°" for loop in loops)
    gain_db = " | ".join("–" if loop.gain_db is None else f"{loop.gain_db:.0f}" for loop in loops)
    return Tile("worst margin, RC | PI", phases, f"phase; gain {gain_db} dB")


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
    what = "Electroadhesive clutch" if kind == "clutch" and of_the_paper(data, results.paper) else "Step responses"
    if data is not None and kind != "clutch":
        what = KINDS[data.kind].capitalize()
    if kind is None:
        what = "Replays" if results.replays else "Gains"
    if results.shows_edges:
        return "Edges of the output"
    return f"{what}: two fits side by side" if results.pair else what


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


def _counted(findings: Sequence[Finding]) -> str:
    counts = Counter(found.severity for found in findings)
    kinds = ((counts["stop"], "stop"), (counts["caution"], "warning"))
    return ", ".join(counted(count, word) for count, word in kinds if count) or "no warning"


def _data(results: Results, known: Known) -> Light:
    data, fit, findings = results.main_data, results.main_fit, known["data"]
    if data is not None:
        warned = sum(1 for run in data.runs if warnings_of(run))
        text = f"{warned} of {counted(len(data.runs), 'run')}"
        text = text if warned else f"{counted(len(data.runs), 'run')}, no warning"
        return Light("Data", _worst([_grade(findings), "care" if warned else "good"]), text, "data")
    if fit is not None and fit.data.sources:
        text = f"{counted(len(rising(fit.data.sources)), 'run')}; {_counted(findings)}"
        return Light("Data", _grade(findings), text, "data")
    if results.shows_edges:
        count = sum(len(edges) for _run, edges in results.edge_logs)
        logs = counted(len(results.edge_logs), "log")
        return Light("Data", _grade(findings) if count else "care", f"{logs}, {counted(count, 'edge')}", "data")
    return Light("Data", "none", "no data given", "appendix")


def _model(results: Results, known: Known) -> Light:
    fit = results.main_fit
    if fit is None:
        return Light("Model", "none", "no fit given", "appendix")
    if not fit.verdict.usable:
        return Light("Model", "bad", "NOT USABLE", "model")
    findings, percent = known["model"], fit_pct(results)
    lead = "usable; " if percent is None else f"fits {number(percent, 3)} %; "
    return Light("Model", _grade(findings), f"{lead}{_counted(findings)}", "model")


def _controller(results: Results, known: Known) -> Light:
    if not results.gains:
        return Light("Controller", "none", "no gains given", "controller" if results.fit("clutch") else "appendix")
    gains = results.gains[0].result
    grade = _grade(known["controller"])
    if grade == "good" and gains.guarantee is not None and gains.guarantee.holds is False:
        grade = "care"
    return Light("Controller", grade, f"guarantee {guarantee_words(gains)}", "controller")


MARK = "Fit NOT USABLE: do not quote"


def mark_of(results: Results) -> tuple[str, list[str]] | None:
    """The mark, and why; None where no fit is given, and no gains or replays of one, that must not be used."""
    reasons = [one.result.verdict.why for one in results.fits]
    reasons += [one.result.not_usable or "" for one in results.gains]
    reasons += [why for replay in results.replays for why in replay.result.head.not_usable.values()]
    told = list(dict.fromkeys(why for why in reasons if why))
    return (MARK, told) if told else None


SCENARIOS = ("multisine", "reference", "steps")
"""Replays that are shown, the best first."""
WIDTH_IN, HEIGHT_IN = 5.0, 2.75
SHOWN_S = 20.0
"""Most of a replay that is shown [s]."""


def pictures(results: Results) -> list[tuple[str, str, Sheet]]:
    """Title, part of the page where more of it stands, and picture: the first two that there are."""
    return list(islice(_candidates(results), 2))


def _picture(panels: Sequence[Panel], ratios: tuple[float, ...] = (), columns: int = 1) -> Sheet:
    return Sheet(panels, HEIGHT_IN, WIDTH_IN, columns, ratios, lettered=False)


def _candidates(results: Results) -> Iterator[tuple[str, str, Sheet]]:
    """Described when wanted, the best first.

    The model on its data, controllers, fitted values over the level, or a step with the curve that it asks for.
    """
    data, fit = results.main_data, results.main_fit
    drawn = logs.drawn_logs(fit.recorded.logs) if fit is not None and fit.recorded is not None else []
    if fit is not None and drawn:  # the input, and below it the output and the model driven by that input alone
        units = fit.data.input_unit, fit.data.output_unit
        yield "Measured against model", "model", _picture(logs.log_panels(drawn[-1].curve, units)[:2], (1, 2))
    elif data is not None:
        models = steps.nonlinear_curves(fit, data) or steps.single_curves(fit)
        few = replace(data, levels=tuple(steps.some_of(data.levels, 6)))
        said, part = ("Measured against model", "model") if models else ("Measured", "data")
        yield said, part, _picture([steps.steps_panel(few, models)])
    replay = next(filter(None, map(results.replay, SCENARIOS)), None)
    if replay is not None:
        until = replays.counted_from(replay) + SHOWN_S
        panels = replays.tracking_panels(replay, until)[:2]
        yield "Controllers against the reference", "replay", _picture(panels, (1.6, 1))
    if fit is None:
        return
    if len(believed_levels(fit)) > 1:
        yield "Fitted values over the level", "model", _picture(values.value_panels(fit), columns=3)
    for recorded in (given.result for given in results.data):
        if recorded.kind == fit.data.kind and steps.paired(recorded, fit.steps):
            panel = steps.level_steps_panel(recorded, fit.steps)
            yield "Steps, each by its own curve", "model", _picture([panel])
