"""Findings by the page's parts, and the first screen: data, model and controller at a glance, pictures, numbers."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from eaid.errors import on_command_line
from eaid.findings import Finding, enumerated, merged, ranked, say
from eaid.findings.finding import MOST_TOLD
from eaid.report.figures import replays, sessions, steps, values
from eaid.report.figures.residuals import residual_panels
from eaid.report.panels import Axis, Panel, Sheet
from eaid.report.results import EXPERIMENT_NAMES, Results
from eaid.report.rig import level_text
from eaid.report.tables import Column, Table
from eaid.report.tables.data import distinct, is_warned
from eaid.report.tables.gains import controllers_table, guarantee_story
from eaid.report.tables.replays import errors_table
from eaid.report.tables.sessions import next_table, promise_table, shifts_table
from eaid.results import summary
from eaid.results.replay import Replay
from eaid.results.verdict import in_short
from eaid.sessions.compare import CLAIMED
from eaid.shown import counted, number, span

MODEL_WORDS = {"friction": "friction curves", "nonlinear": "nonlinear model", "linear": "linear model",
               "release": "release"}  # fmt: skip
# Findings of single runs that say how far the model is from them
ABOUT_THE_CURVE = {"shape-misses", "other-shape-fits-better"}

ByPart = Mapping[str, tuple[Finding, ...]]  # Part of the page → its findings, the gravest first


def known_findings(results: Results, kind: str | None = None) -> ByPart:
    """All findings, of data and its first fit those of one kind, the page's own or another; sorted, those of one code
    as one."""
    results = results.of_kind(kind or results.main_kind)
    found: dict[str, list[Finding]] = {
        "data": [one for data in results.data for one in data.result.all_findings], "model": [],
        "controller": [one for gains in results.gains for one in gains.result.findings],
        "replay": [one for replay in results.replays for one in replay.result.findings],
        "sessions": [one for given in results.comparisons for one in given.result.findings],
    }  # fmt: skip
    found["sessions"] += [one for given in results.rigs for one in given.result.findings]
    for one in (one for fit in results.fits[:1] for one in fit.result.findings):
        of_the_model = one.subject in (*MODEL_WORDS, "fit", "plant") or one.code in ABOUT_THE_CURVE
        found["model" if of_the_model else "data"].append(one)
    for part, group in found.items():  # each once: a fit repeats what its data already said
        each = {(one.code, one.subject, one.levels, str(one.values.get("what"))): one for one in group}
        found[part] = list(each.values())
    return {part: ranked(merged(ranked(group))) for part, group in found.items()}


def sentence(one: Finding, of_data: bool = False) -> str:
    """A finding in words, with a capital and a full stop, options as the command line has them."""
    said = on_command_line(say(one)).rstrip(".")
    about = f"{MODEL_WORDS[one.subject]}: " if one.subject in MODEL_WORDS else ""
    if of_data and one.subject != "data" and one.subject not in said:
        return f"{one.subject}: {said}."  # a run, by its name
    text = f"{about}{said}"
    as_is = text[:1] in "τφρα" or (not about and text.startswith(one.subject))  # a log's name keeps its letters
    return f"{text[:1] if as_is else text[:1].upper()}{text[1:]}."


def tables(results: Results) -> tuple[Table, ...]:
    """The numbers of the first screen: values at three levels as the terminal has them; controllers side by side."""
    found = [next_table(given.result) for given in results.rigs]
    found += [shifts_table(given.result) for given in results.comparisons if given.result.shifts]
    found += [promise_table(given.result) for given in results.comparisons if given.result.promise]
    if results.main_fit is not None and (cells := summary.values(results.main_fit)):
        heads = tuple(Column(head.replace("[", "(").replace("]", ")")) for head in cells[0])
        part = results.main_fit.nonlinear
        curve = "through which T_s(u) goes" if part and part.through_levels else "which the model's curve may miss"
        apart = any(one.values.get("lag") for one in results.main_fit.findings if one.code == "polynomials-too-low")
        several = part is not None and len(results.main_fit.friction_levels) > 1
        own = several and part is not None and bool(part.through_levels or part.level_scatter or apart)
        of, others = ("T_s, τ1 and τ2", "") if apart else ("T_s", "; τ1, τ2: the curves'")
        whose = f"{of}: each level's own, {curve}{others}." if own else ""
        found.append(Table("Values with 95 % intervals", whose, heads, tuple(map(tuple, cells[1:]))))
    if results.gains:
        whole = controllers_table(results.gains[0].result)  # but for the gains themselves
        rows = tuple((name, *others) for name, _gains, *others in whole.rows)
        return (*found, replace(whole, columns=(whole.columns[0], *whole.columns[2:]), rows=rows))
    replay = _replay_of(results)
    return tuple(found) if replay is None else (*found, errors_table([replay]))


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
    if results.main_kind is None:
        several = "Compared" if results.comparisons else "Sessions of a rig" if results.rigs else ""
        return several or ("Replays" if results.replays else "Gains")
    if results.main_kind != "clutch":
        return EXPERIMENT_NAMES[results.main_kind].capitalize()
    return "Electroadhesive clutch" if results.of_paper else "Step responses"


def chips(results: Results) -> tuple[str, ...]:
    """Where the numbers come from: synthetic or a rig, what was stepped and measured, levels."""
    texts = ["synthetic data"] if results.synthetic else []
    fit, data, about = results.main_fit, results.main_data, results.about
    if about is not None:
        texts.append(f"{about.input_unit} → {about.output_unit}")
    levels = sorted(row.level for row in data.levels) if data is not None else sorted(fit.data.levels) if fit else []
    if fit is not None and fit.logs:
        seconds = sum(log.duration_s for log in fit.logs)
        texts.append(f"{counted(len(fit.logs), 'log')} as recorded, {seconds:.4g} s")
    if levels and about is not None:
        texts.append(span(levels, about.input_unit))
    texts += [f"{letter}: {name}" for one in results.comparisons for letter, name in one.result.files.items()]
    if len(results.kinds) > 1:
        texts.append("with " + " and ".join(EXPERIMENT_NAMES[kind] for kind in results.kinds[1:]))
    return tuple(texts)


def lights(results: Results) -> tuple[Light, ...]:
    """Sessions where there are any, data, model and controller at a glance; by the severity of what was found, never by
    its words."""
    found = known_findings(results)
    several = tuple(_sessions(results))
    if several and not (results.fits or results.gains or results.data):
        return several
    return *several, _data(results, found), _model(results, found), _controller(results, found)


def _sessions(results: Results) -> Iterator[Light]:
    """The verdict of each comparison, and what the next session may be."""
    for found in (given.result for given in results.comparisons):
        for one in (one for one in found.shifts if one.quantity in CLAIMED):
            word = f"{one.verdict}: "
            yield Light(f"A against {one.against}", "care" if one.changed else "good", word + one.words(), "sessions")
        for subject, words in found.plant_words:
            yield Light(subject, "care", f"moved: {words}", "sessions")
        if found.files:
            said = on_command_line(found.retuning)
            yield Light("Make gains anew", "good" if found.tune_anew is False else "care", said, "sessions")
        if found.promise is not None:
            said = "; ".join(f"{one.name}: {one.word}" for one in found.promise.rows)
            where = f"{found.promise.controller} in {found.promise.log}: {said}"
            yield Light("Recorded loop", "good" if found.promise.kept else "care", where, "summary")
    for rig in (given.result for given in results.rigs):
        said, told = rig.lines()[0].removeprefix("rig").strip(), ranked(merged(ranked(rig.findings)))
        yield Light("Rig", _grade(told), f"{said}; {_count_findings(told)}", "sessions")


def _grade(findings: Sequence[Finding]) -> str:
    return min((GRADES[found.severity] for found in findings), key=("bad", "care", "good").index, default="good")


def _count_findings(findings: Sequence[Finding], unit: str = "") -> str:
    """`2 warnings: repeats disagree at 60 %, τ2 open`; the gravest are named."""
    grave = [found for found in findings if found.severity != "note"]
    counts = Counter(found.severity for found in grave)
    kinds = ((counts["stop"], "stop"), (counts["caution"], "warning"))
    said = ", ".join(counted(count, word) for count, word in kinds if count)
    names = []
    for one in grave[:MOST_TOLD]:
        at = f" at {level_text(one.levels[0], unit)}" if len(one.levels) == 1 else ""
        suspected = one.code == "several-sessions"
        names.append(f"{one.values['sessions']} sessions suspected" if suspected else in_short(one) + at)
    return f"{said}: {', '.join(dict.fromkeys(names))}{', …' * (len(grave) > MOST_TOLD)}" if grave else "no warning"


def _data(results: Results, known: ByPart) -> Light:
    data, fit, findings = results.main_data, results.main_fit, known["data"]
    about = data if data is not None else fit.data if fit is not None and fit.data.sources else None
    if about is None:
        return Light("Data", "none", "no data given", "appendix")
    of_fit = [one for one in fit.data.sources if one.edge != "falling"] if fit else []
    runs = len(of_fit) if data is None else len(distinct(data.runs))
    warned, grade = 0 if data is None else len(distinct(filter(is_warned, data.runs))), _grade(findings)
    text = f"{warned} of {counted(runs, 'run')} warned; " if warned else f"{counted(runs, 'run')}; "
    grade = "care" if warned and grade == "good" else grade
    return Light("Data", grade, text + _count_findings(findings, about.input_unit), "data")


def _model(results: Results, known: ByPart) -> Light:
    fit = results.main_fit
    if fit is None:
        return Light("Model", "none", "no fit given", "appendix")
    if not fit.verdict.usable:
        return Light("Model", "bad", on_command_line(f"NOT USABLE: {fit.verdict.sentence}"), "model")
    findings, percents = known["model"], [row.fit_pct for row in fit.friction_levels if row.fit_pct is not None]
    percent = float(np.mean(percents)) if percents else None
    if fit.nonlinear is not None and fit.nonlinear.fit_pct is not None:  # of all its data
        percent = fit.nonlinear.fit_pct
    if fit.another_plant is not None:
        percent = fit.another_plant.tried[0].fit_pct
    left, held = fit.verdict.not_at, getattr(fit.recorded and fit.recorded.hold_out, "held_pct", None)
    unseen = "" if held is None else f", {number(held, 3)} % of what was left out"
    usable = f"usable{f', not at {enumerated(left, fit.data.input_unit)}' if left else ''}"
    explains = "" if percent is None else f", fits {number(percent, 3)} %{unseen} (100 % = perfect)"
    lead = f"{usable}{explains}; "
    return Light("Model", _grade(findings), lead + _count_findings(findings, fit.data.input_unit), "model")


def _controller(results: Results, known: ByPart) -> Light:
    if not results.gains:
        return Light("Controller", "none", "no gains given", "controller" if results.fit("clutch") else "appendix")
    gains = results.gains[0].result
    grade = _grade(known["controller"])
    if grade == "good" and (gains.guarantee is None or gains.guarantee.holds is False):
        grade = "care"
    return Light("Controller", grade, ". ".join(said.rstrip(".") for said in guarantee_story(gains)), "controller")


NOT_USABLE_MARK = "Fit NOT USABLE: do not quote"


def mark_of(results: Results) -> tuple[str, list[str]] | None:
    """The mark, and why; None where no fit is given, and no gains or replays of one, that must not be used."""
    reasons = [one.result.verdict.sentence for one in results.fits]
    reasons += [one.result.not_usable or "" for one in results.gains]
    reasons += [why for replay in results.replays for why in replay.result.head.not_usable.values()]
    told = list(dict.fromkeys(on_command_line(why) for why in reasons if why))
    return (NOT_USABLE_MARK, told) if told else None


SHOWN_SCENARIOS = ("multisine", "reference", "steps")  # Replays that are shown, the best first
SHOWN_S = 20.0  # So much of a replay is shown [s], of a long one a quarter


def _replay_of(results: Results) -> Replay | None:
    """The replay that is shown."""
    return next(filter(None, map(results.replay, SHOWN_SCENARIOS)), None)


def _picture(panels: Sequence[Panel], ratios: tuple[float, ...] = (), columns: int = 1) -> Sheet:
    return Sheet(panels, 2.5, 5.0, columns, ratios, lettered=False)


def pictures(results: Results) -> Iterator[tuple[str, str, Sheet]]:
    """Title, part of the page where more of it stands, and picture, described when wanted, the best first.

    The model on its data, controllers, fitted values over the level, or a step with the curve that it asks for.
    """
    data, fit, replay = results.main_data, results.main_fit, _replay_of(results)
    for rig in (given.result for given in results.rigs):
        yield "The rig over its sessions", "sessions", _picture([sessions.control_panel(rig)])
    for one in (given.result for given in results.comparisons if given.result.values):
        yield "Sessions on top of each other", "sessions", _picture([sessions.values_panel(one)])
    drawn = replays.drawn_logs(fit.logs) if fit is not None else []
    if fit is not None and drawn:  # the input, and below it the output and the model driven by that input alone
        units = fit.data.input_unit, fit.data.output_unit
        yield "Measured against model", "model", _picture(replays.log_panels(drawn[-1].curve, units)[:2], (1, 2))
    elif data is not None:
        models = steps.nonlinear_curves(fit, data) or steps.single_curves(fit)
        panels = [steps.steps_panel(replace(data, levels=tuple(steps.some_of(data.levels, 6))), models)]
        model = None if fit is None else fit.nonlinear
        rows = model.per_level if model is not None else fit.friction_levels if fit is not None else ()
        shares = [(row.fit_pct, row.level) for row in rows if row.fit_pct is not None]
        worst = min(shares) if shares and len(data.levels) > 1 else None
        alone = tuple(row for row in data.levels if worst is not None and row.level == worst[1])
        if alone and worst is not None:  # the level that the model follows least, on a scale of its own
            panel = steps.steps_panel(replace(data, levels=alone), models)
            bare = [replace(line, end="") for line in panel.lines]
            title = f"worst: {level_text(worst[1], data.input_unit)}, {worst[0]:.0f} %".replace("-", "−")
            panels.append(replace(panel, y=Axis(), lines=bare, legend="", title=title))
        said, part = ("Measured against model", "model") if models else ("Measured", "data")
        widths = (1.6, 1) if len(panels) > 1 else ()
        yield said, part, replace(_picture(panels, columns=len(panels)), widths=widths, shared=False)
    if replay is not None:
        from_s = replays.counted_from(replay)
        end_s = max(float(one.columns["time_s"][-1]) for one in replay.records.values())
        until = from_s + max(SHOWN_S, (end_s - from_s) / 4)
        panels = replays.tracking_panels(replay, until)[:2]
        yield "Controllers against the reference, simulated", "replay", _picture(panels, (1.6, 1))
    if fit is None:
        return
    if len(fit.level_values) > 1:
        panels = values.value_panels(fit)
        yield "Fitted values over the level", "model", _picture(panels, columns=len(panels))
    for recorded in (given.result for given in results.data):
        if recorded.kind == fit.data.kind and steps.paired(recorded, fit.steps):
            panel = steps.level_steps_panel(recorded, fit.steps)
            yield "Steps, each by its own curve", "model", _picture([panel])
    if (left := residual_panels(fit, data)) is not None:
        yield "What the model leaves", "model", _picture(left.panels[:2], columns=2)
