"""Six numbers of the first screen: fit, T_s, τ1, τ2 at the top level, largest errors, margins; or those of edges."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eaid.report.figures.steps import model_curves
from eaid.report.results import Results
from eaid.report.rig import controller_name, level_text
from eaid.report.tables.replays import SCENARIO_NAMES, metric
from eaid.report.tables.table import interval, number
from eaid.results.fit import Fit
from eaid.results.friction import FrictionLevel
from eaid.results.nonlinear import CurveLevel
from eaid.results.summary import ENDLESS_S, believed_levels, steps_of_other_shapes
from eaid.shown import counted


@dataclass(frozen=True)
class Tile:
    """One number of the first screen."""

    label: str
    value: str
    note: str


def fit_pct(results: Results) -> float | None:
    """100 (1 − ‖y − ŷ‖/‖y − mean y‖) of the page's model, as the fit says or over the data given."""
    fit, data = results.main_fit, results.main_data
    if fit is not None and fit.nonlinear is not None and fit.nonlinear.fit_pct is not None:
        return fit.nonlinear.fit_pct
    models = model_curves(fit, data)
    rows = [(row.mean, models[row.level](row.time_s)) for row in data.levels if row.level in models] if data else []
    if rows:
        y, fitted = (np.concatenate([row[k] for row in rows]) for k in (0, 1))
        spread = float(np.linalg.norm(y - y.mean()))
        return 100 * (1 - float(np.linalg.norm(y - fitted)) / spread) if spread > 0 else None
    shares = [row.fit_pct for row in (fit.friction.levels if fit and fit.friction else ()) if row.fit_pct is not None]
    return float(np.mean(shares)) if shares else None


def tiles(results: Results) -> tuple[Tile, ...]:
    """Six numbers: fit, T_s, τ1, τ2 at the top level, largest errors, worst margin; else those of edges."""
    if results.shows_edges:
        return _edges(results)
    share = fit_pct(results)
    found = [Tile("fit", f"{number(share, 3)} %" if share is not None else "–", "100 % would be on the data")]
    return (*found, *_values(results.main_fit), _errors(results), _margins(results))


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
