"""The head of the page: what it is about, where the numbers come from, and three lights."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from eaid.findings import Finding
from eaid.report.page.known import Known
from eaid.report.page.tiles import fit_pct
from eaid.report.results import KINDS, Results
from eaid.report.rig import level_text, of_the_paper, rising
from eaid.report.tables.data import doubts_of
from eaid.report.tables.gains import guarantee_words
from eaid.report.tables.table import number
from eaid.shown import counted

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
        asked_for = any(log.run.reference_nm is not None for log in results.edge_logs)
        what = "Edges of a closed loop" if asked_for else "Edges of the output"
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
    if results.shows_edges:
        loops = results.edge_logs
        duration = sum(float(log.run.time_s[-1]) for log in loops)
        texts += [loops[0].run.output_unit or "output", f"{counted(len(loops), 'log')} as recorded, {duration:.4g} s"]
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
    kinds = ((counts["stop"], "stop"), (counts["caution"], "reservation"))
    return ", ".join(counted(count, word) for count, word in kinds if count) or "no reservation"


def _data(results: Results, known: Known) -> Light:
    data, fit, findings = results.main_data, results.main_fit, known["data"]
    if data is not None:
        doubtful = sum(1 for run in data.runs if doubts_of(run))
        text = f"{doubtful} of {len(data.runs)} runs doubtful"
        text = text if doubtful else f"{counted(len(data.runs), 'run')}, none doubtful"
        return Light("Data", _worst([_grade(findings), "care" if doubtful else "good"]), text, "data")
    if fit is not None and fit.data.sources:
        text = f"{counted(len(rising(fit.data.sources)), 'run')}; {_counted(findings)}"
        return Light("Data", _grade(findings), text, "data")
    if results.shows_edges:
        count = sum(len(log.edges) for log in results.edge_logs)
        loop = len(results.edge_logs) == 1 and results.edge_logs[0].run.reference_nm is not None and count < 100
        logs = "closed loop" if loop else counted(len(results.edge_logs), "log")
        edges = counted(count, "edge") if count else "no edge"
        return Light("Data", _grade(findings) if count else "care", f"{logs}, {edges}", "data")
    return Light("Data", "none", "no data given", "appendix")


def _model(results: Results, known: Known) -> Light:
    fit = results.main_fit
    if fit is None:
        return Light("Model", "none", "no fit given", "appendix")
    findings = known["model"]
    grade, percent = _grade(findings), fit_pct(results)
    if fit.converged is False:
        return Light("Model", "bad", "a fit did not converge: do not use it", "model")
    lead = "do not use; " if grade == "bad" else "usable; " if percent is None else f"fits {number(percent, 3)} %; "
    return Light("Model", grade, f"{lead}{_counted(findings)}", "model")


def _controller(results: Results, known: Known) -> Light:
    if not results.gains:
        return Light("Controller", "none", "no gains given", "controller" if results.fit("clutch") else "appendix")
    gains = results.gains[0].result
    grade = _grade(known["controller"])
    if grade == "good" and gains.guarantee is not None and gains.guarantee.holds is False:
        grade = "care"
    return Light("Controller", grade, f"guarantee {guarantee_words(gains)}", "controller")
