"""The first screen: what the page is about, three lights, six numbers, and what to do next."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eaid.findings import Finding
from eaid.report.page.known import Known
from eaid.report.ready_fits import main_kind, models_for
from eaid.report.results import KINDS, Results
from eaid.report.rig import level_text, of_the_paper, rising
from eaid.report.style import controller_name
from eaid.report.tables.data import doubts_of
from eaid.report.tables.gains import guarantee_words
from eaid.report.tables.replays import SCENARIO_NAMES, metric
from eaid.report.tables.table import interval, number
from eaid.results.fit import Fit
from eaid.results.friction import FrictionLevel
from eaid.results.nonlinear import CurveLevel
from eaid.results.summary import ENDLESS_S, believed_levels, steps_of_other_shapes
from eaid.shown import counted

GRADES = {"stop": "bad", "caution": "care", "note": "good"}
_DATE = re.compile(r"(?<!\d)(20\d\d)[-_.]?(0[1-9]|1[0-2])[-_.]?(0[1-9]|[12]\d|3[01])(?!\d)")


@dataclass(frozen=True)
class Light:
    """One thing at a glance: good, care (read first), bad (do not use) or none (not given), and where to look."""

    name: str
    grade: str
    text: str
    part: str


@dataclass(frozen=True)
class Tile:
    """One number of the first screen."""

    label: str
    value: str
    note: str


def title(results: Results, asked: bool | None) -> str:
    """What the page is about."""
    kind = main_kind(results)
    fit = results.fit(kind) if kind else None
    data = fit.data if fit is not None else results.data_of(kind) if kind else None
    what = "Electroadhesive clutch" if kind == "clutch" and of_the_paper(data, asked) else "Step responses"
    if data is not None and kind != "clutch":
        what = KINDS[data.kind].capitalize()
    if kind is None:
        what = "Replays" if results.replays else "Gains"
    if shows_edges(results):
        asked_for = any(log.run.reference_nm is not None for log in results.edge_logs)
        what = "Edges of a closed loop" if asked_for else "Edges of the output"
    return f"{what}: two fits side by side" if results.pair else what


def shows_edges(results: Results) -> bool:
    """Whether the page is about edges of outputs: logs of closed loops, and no fit and no steps beside them."""
    return bool(results.edge_logs) and not results.fits and not any(one.result.levels for one in results.data)


def of_paper(results: Results, asked: bool | None) -> bool:
    """Whether the page's own kind was recorded as the paper's was."""
    kind = main_kind(results)
    fit = results.fit(kind) if kind else None
    return kind is None or of_the_paper(fit.data if fit is not None else results.data_of(kind), asked)


def chips(results: Results) -> tuple[str, ...]:
    """Where the numbers come from: synthetic or a rig, what was stepped and measured, levels, date of the logs."""
    found = ["synthetic data"] if results.synthetic else []
    kind = main_kind(results)
    fit, data = (results.fit(kind), results.data_of(kind)) if kind else (None, None)
    about = fit.data if fit is not None else data
    if about is not None:
        found.append(f"{about.input_unit or 'level'} → {about.output_unit or 'output'}")
    levels = sorted(row.level for row in data.levels) if data is not None else sorted(fit.data.levels) if fit else []
    if fit is not None and fit.recorded is not None and fit.recorded.logs:
        logs = fit.recorded.logs
        found.append(
            f"{len(logs)} log{'s' if len(logs) > 1 else ''} as recorded, {sum(o.duration_s for o in logs):.4g} s"
        )
    if shows_edges(results):
        loops = results.edge_logs
        duration = sum(float(log.run.time_s[-1]) for log in loops)
        found += [loops[0].run.output_unit or "output", f"{counted(len(loops), 'log')} as recorded, {duration:.4g} s"]
    if levels and about is not None:
        span = f"{levels[0]:.4g} to {level_text(levels[-1], about.input_unit)}"
        found.append(f"{len(levels)} levels, {span}" if len(levels) > 1 else level_text(levels[0], about.input_unit))
    names = [run.source for run in data.runs] if data is not None else []
    names += [one.path for one in fit.data.sources] if fit is not None else []
    dates = sorted({"-".join(match.groups()) for name in names if (match := _DATE.search(name.rsplit("/", 1)[-1]))})
    if dates:
        found.append(f"logs of {dates[0]}" if len(dates) == 1 else f"logs of {dates[0]} to {dates[-1]}")
    if len(results.kinds) > 1:
        found.append("with " + " and ".join(KINDS[one] for one in results.kinds[1:]))
    return tuple(found)


def lights(results: Results, known: Known) -> tuple[Light, Light, Light]:
    """Data, model and controller at a glance; by the severity of what was found, never by its words."""
    return _data(results, known), _model(results, known), _controller(results, known)


def _grade(found: Sequence[Finding]) -> str:
    return min((GRADES[one.severity] for one in found), key=("bad", "care", "good").index, default="good")


def _counted(found: Sequence[Finding]) -> str:
    stops, cautions = (sum(one.severity == severity for one in found) for severity in ("stop", "caution"))
    said = [f"{n} {word}{'s' if n > 1 else ''}" for n, word in ((stops, "stop"), (cautions, "reservation")) if n]
    return ", ".join(said) or "no reservation"


def _data(results: Results, known: Known) -> Light:
    kind = main_kind(results)
    data, fit = (results.data_of(kind), results.fit(kind)) if kind else (None, None)
    found = known.of("data")
    if data is not None:
        doubtful = sum(1 for run in data.runs if doubts_of(run))
        said = f"{counted(len(data.runs), 'run')}, none doubtful"
        if doubtful:
            said = f"{doubtful} of {len(data.runs)} runs doubtful"
        grade = min(_grade(found), "care" if doubtful else "good", key=("bad", "care", "good").index)
        return Light("Data", grade, said, "data")
    if fit is not None and fit.data.sources:
        return Light(
            "Data", _grade(found), f"{counted(len(rising(fit.data.sources)), 'run')}; {_counted(found)}", "data"
        )
    if shows_edges(results):
        count = sum(len(log.edges) for log in results.edge_logs)
        loop = len(results.edge_logs) == 1 and results.edge_logs[0].run.reference_nm is not None and count < 100
        said = "closed loop" if loop else counted(len(results.edge_logs), "log")
        told = counted(count, "edge") if count else "no edge"
        return Light("Data", _grade(found) if count else "care", f"{said}, {told}", "data")
    return Light("Data", "none", "no data given", "appendix")


def _model(results: Results, known: Known) -> Light:
    kind = main_kind(results)
    fit = results.fit(kind) if kind else None
    if fit is None:
        return Light("Model", "none", "no fit given", "appendix")
    found = known.of("model")
    grade, share = _grade(found), fit_pct(results)
    if fit.converged is False:
        return Light("Model", "bad", "a fit did not converge: do not use it", "model")
    lead = "do not use; " if grade == "bad" else "usable; " if share is None else f"fits {number(share, 3)} %; "
    said = f"{lead}{_counted(found)}"
    return Light("Model", grade, said, "model")


def _controller(results: Results, known: Known) -> Light:
    if not results.gains:
        return Light("Controller", "none", "no gains given", "controller" if results.fit("clutch") else "appendix")
    gains = results.gains[0].result
    found = known.of("controller")
    grade = _grade(found)
    if grade == "good" and gains.guarantee is not None and gains.guarantee.holds is False:
        grade = "care"
    return Light("Controller", grade, f"guarantee {guarantee_words(gains)}", "controller")


def fit_pct(results: Results) -> float | None:
    """100 (1 − ‖y − ŷ‖/‖y − mean y‖) of the page's model, as the fit says or over the data given."""
    kind = main_kind(results)
    fit, data = (results.fit(kind), results.data_of(kind)) if kind else (None, None)
    if fit is not None and fit.nonlinear is not None and fit.nonlinear.fit_pct is not None:
        return fit.nonlinear.fit_pct
    models = models_for(results, kind) if kind else {}
    rows = [(row.mean, models[row.level](row.time_s)) for row in data.levels if row.level in models] if data else []
    if rows:
        y, fitted = (np.concatenate([row[k] for row in rows]) for k in (0, 1))
        spread = float(np.linalg.norm(y - y.mean()))
        return 100 * (1 - float(np.linalg.norm(y - fitted)) / spread) if spread > 0 else None
    shares = [row.fit_pct for row in (fit.friction.levels if fit and fit.friction else ()) if row.fit_pct is not None]
    return float(np.mean(shares)) if shares else None


def tiles(results: Results) -> tuple[Tile, ...]:
    """Six numbers: fit, T_s, τ1, τ2 at the top level, largest errors, worst margin; else those of edges."""
    if shows_edges(results):
        return _edges(results)
    kind = main_kind(results)
    fit = results.fit(kind) if kind else None
    share = fit_pct(results)
    found = [Tile("fit", f"{number(share, 3)} %" if share is not None else "–", "100 % would be on the data")]
    return (*found, *_values(fit), _errors(results), _margins(results))


def _edges(results: Results) -> tuple[Tile, ...]:
    logs = results.edge_logs
    every = [one for log in logs for one in log.edges]
    out = logs[0].run.output_unit
    settled = [one.settling_s for one in every if one.settling_s is not None]
    left = [
        abs(goal - e.after) for log in logs for goal, e in zip(log.goals, log.edges, strict=True) if goal is not None
    ]
    errors = [log.rms_error for log in logs if log.rms_error is not None]

    def worst(values: Sequence[float], unit: str, digits: int = 3) -> str:
        return f"{number(max(values), digits)} {unit}".rstrip() if values else "–"

    sizes = [abs(one.after - one.before) for one in every]
    return (
        Tile("edges", str(len(every)), f"in {counted(len(logs), 'log')}"),
        Tile("largest edge", worst(sizes, out), "change of the output"),
        Tile("slowest rise", worst([one.rise_s for one in every], "s"), "10 to 90 % of the change"),
        Tile("largest overshoot", worst([one.overshoot_pct for one in every], "%"), "of the change"),
        Tile("longest settling", worst(settled, "s"), f"within 5 %; {len(settled)} of {len(every)} settle"),
        Tile("left over | RMS error", f"{worst(left, '')} | {worst(errors, '')}" if errors else "–",
             f"{out} from the reference" if errors else "no reference in the log"),
    )  # fmt: skip


def _values(fit: Fit | None) -> list[Tile]:
    words = {"Ts": ("T_s", "steady output"), "tau1": ("τ1", "fast time constant"), "tau2": ("τ2", "slow time constant")}
    rows: Sequence[CurveLevel | FrictionLevel] = believed_levels(fit) if fit is not None else ()
    steps = steps_of_other_shapes(fit) if fit is not None else []
    if fit is None or not (rows or steps):
        return [Tile(label, "–", meaning) for label, meaning in words.values()]
    level = max(row.level for row in steps or rows)
    top = next(row for row in steps or rows if row.level == level)
    lower = sorted((row for row in rows if row.level < level), key=lambda row: row.level) if not steps else []
    lower = [lower[k] for k in sorted({0, (len(lower) + 1) // 2})] if len(lower) > 1 else lower
    found = []
    for name, (label, meaning) in words.items():
        unit = fit.data.output_unit if name == "Ts" else "s"
        key = "change" if steps and name == "Ts" else name
        ends, value = (getattr(one, key) if one is not None else None for one in (top.ci95, top))
        if steps and name == "tau1" and steps[0].dead_time_s:
            meaning += f", behind a dead time of {number(steps[0].dead_time_s, 3)} s"
        note = f"{interval(ends)}, 95 %; {meaning}" if ends is not None else f"{meaning}; no interval"
        for row in lower:
            if getattr(row, name) is not None and (name == "Ts" or getattr(row, name) <= ENDLESS_S):
                note += f"; {number(getattr(row, name), 3)} at {level_text(row.level, fit.data.input_unit)}"
        endless = value is None or (name != "Ts" and ends is None and value > ENDLESS_S)
        said = ("–" if value is None else "not estimable") if endless else f"{number(value, 3)} {unit}"
        found.append(Tile(f"{label} at {level_text(level, fit.data.input_unit)}", said, note))
    return found


def _errors(results: Results) -> Tile:
    replay = results.replay("multisine") or next(
        (one.result for one in results.replays if "rc" in one.result.records), None
    )
    values, unit, where = {}, "", "no replay given"
    if replay is not None:
        values = {name: metric(replay, name, "max_abs_error_nm") for name in ("rc", "pi") if name in replay.records}
        scenario = replay.head.scenario
        unit, where = replay.head.output_unit, SCENARIO_NAMES.get(scenario, scenario)
    elif results.gains and (told := results.gains[0].result.replayed) is not None:
        known = {"rc": told.rc, "pi": told.pi}
        values = {name: one.max_abs_error_nm for name, one in known.items() if one is not None}
        unit, where = results.gains[0].result.output_unit, SCENARIO_NAMES.get(told.reference, told.reference)
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
    both = [one for one in (worst.rc, worst.pi) if one is not None]
    phases = " | ".join("–" if one.phase_deg is None else f"{one.phase_deg:.0f}°" for one in both)
    shares = " | ".join("–" if one.gain_db is None else f"{one.gain_db:.0f}" for one in both)
    return Tile("worst margin, RC | PI", phases, f"phase; gain {shares} dB")
