"""`today`: one or two reference steps of a new session → a fit whose intervals are those of the next session.

T_s, τ1, τ2 and B are foreseen at the levels of the session with the most of them (`base`), given the steps. Each of its
curves p(u) is put through p(u) e^d(u), d the logarithm of the foreseen over its own, straight in ln u between levels,
by least squares of the relative error; its coefficients get the covariance by which the foreseen values go together,
so that drawn plants are those of the next session. B_m and B_M are the outermost ends of the levels' intervals of B.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace as plain_replace
from typing import Any

import numpy as np
from msgspec.structs import replace
from scipy.linalg import block_diag
from scipy.optimize import minimize_scalar
from scipy.special import stdtrit

from eaid.arrays import Array, best_gain, median
from eaid.declared import given_options, part
from eaid.errors import DataError
from eaid.estimate.coefficients import CURVES_ORDER, with_intervals
from eaid.estimate.scatter import bartlett_variance
from eaid.estimate.spread import log_interval_of
from eaid.findings import Finding, finding, ranked, stops
from eaid.levels.workflow import fit_steps
from eaid.options import FitOptions, ReadOptions
from eaid.plant.dynamics import Plant
from eaid.plant.forms import scales, terms
from eaid.plant.respond import from_rest
from eaid.plant.steps import decay
from eaid.replay.compare import of_own_logs
from eaid.results import models as parts
from eaid.results.fit import Fit
from eaid.results.models import LevelIntervals
from eaid.results.parameters import parameters_of
from eaid.results.plant import FittedPlant, PlantIntervals, names_of, number_at
from eaid.results.responses import LevelResponse, ResponseIntervals, responses_of
from eaid.sessions.gather import (
    MANY,
    NO_INTERVAL,
    RESPONSES,
    RIG_NAME,
    WHOLE_NUMBERS,
    logs_of,
    of_another_plant,
    of_whole_plant,
    told_together,
    values_of_fit,
)
from eaid.sessions.model import NO_STEPS, KnownValues, Next, between, steps_known
from eaid.sessions.rig import Rig
from eaid.steps.stepset import StepSet

NOT_FITTED = dict.fromkeys(("solver", "samples", "rmse", "sse", "fit_pct", "R2"))
AS_READ = ("signs-turned", "input-late")  # How the plant takes a log, which a fit holds as a finding
INPUTS_DRAWN = 11  # Over the range, beside the levels, through which a curve is put
# Part of τ1 by which a step's dead time may lie off the plant's; factor by which τ1 may lie off a step's interval
LATE_PART, TAU_SCATTER = 0.1, 1.05
HARDLY_SURER = 0.97  # Part of the factor of T_s that steps leave of that without them, where they tell next to nothing
# How far off the sessions' pace a step's is looked for, and at how many, in the logarithm; of its derivative
FARTHEST_PACE, PACES_TRIED, PACE_STEP = 1.1, 23, 1e-4
NextByName = Mapping[str, Next]  # What the sessions know, by its name


def reading_of(rig: Rig, given: ReadOptions | None) -> ReadOptions:
    """How reference steps are read: as the logs of the sessions, but for what is given."""
    before = rig.base.options.reading if rig.base is not None else {}
    kept = {name: value for name, value in before.items() if name not in ("levels", "repair")}
    return given_options(ReadOptions, None, {**kept, **(given.stated() if given is not None else {})})


def today(rig: Rig, step: Fit | StepSet) -> Fit:
    """`eaid.today`: DataError for a rig of a plain table, or steps of another rig or of its own sessions."""
    base = rig.base
    if base is None:
        raise DataError("the rig is of a plain table and holds no plant; its `next(steps=…)` says what today's may be")
    if "Ts" not in rig.quantities:
        raise DataError("the rig holds no T_s of its sessions; make it again with eaid sessions")
    shown = step if isinstance(step, Fit) else _fitted(base, step)
    names = {one.sha256: session.name for session in rig.sessions for one in session.logs if one.sha256}
    if again := [one for one in logs_of(shown) if one.sha256 in names]:
        was = names[again[0].sha256]
        raise DataError(f"{again[0].path}: is a log of session {was} already; give a step of the new session")
    paths = [one.path for one in logs_of(shown)] or [] if isinstance(step, Fit) else [path for path, _ in step.inputs]
    told_together({RIG_NAME: base, next(filter(None, paths), "today"): shown})
    steps = {name: _steps(rig, shown, name) for name in rig.quantities}
    if not shown.level_values:
        raise DataError("the logs hold no step from rest, which a reference step is; record one, from rest to a level")
    if not len(steps["Ts"].y):
        raise DataError("no reference step has a T_s above 0; record one whose output rises")
    if not (rows := base.level_values or [row for _, row in of_another_plant(base)]):
        raise DataError(f"the fit that the rig's plant is of: {NO_INTERVAL}, and make the rig again")
    levels, model = np.array([row.level for row in rows]), rig.main.model(rig.names)
    if not np.isin(model.part_at(steps["Ts"].level), model.part_at(levels)).any():
        there = ", ".join(f"{u:.4g}" for u in levels.tolist()) + f" {rig.input_unit}".rstrip()
        raise DataError(
            f"no reference step is at a level that shares a session with those of the rig's plant ({there}), and "
            "another tells nothing of them; record one there"
        )
    whole = {name for name in rig.quantities if of_whole_plant(base, name)}
    known = {name: rig.foreseen(np.ones(1) if name in whole else levels, steps[name], name) for name in rig.quantities}
    foreseen, of_all = ({name: one for name, one in known.items() if (name in whole) is to} for to in (False, True))
    made = _with_levels(base, rows, foreseen)
    made = _with_linear(_with_plant(made, rows, foreseen, of_all), rows, foreseen, of_all.get("a0"))
    uncertainty = replace(base.uncertainty or parts.Uncertainty(), ci="sessions", share=None, lack_of_fit=())
    own = {"sources": shown.data.sources, "inputs": shown.data.inputs}
    data = replace(base.data, **own, repeats=(), samples=(), replayed=())
    held = [] if "held" not in foreseen else [
        LevelResponse(u, 0, **values, ci95=ResponseIntervals(ends.get("held"), ends.get("peak")))
        for k, u in enumerate(levels.tolist()) for values, ends in (_at(foreseen, RESPONSES, k),)
    ]  # fmt: skip
    late_s, moved = plant_in_steps(rig, base, shown)
    if made.plant_ is not None and late_s is not None:  # which the sessions' interval is not of
        ends = made.plant_.ci95 and replace(made.plant_.ci95, dead_time_s=None)
        made = replace(made, plant_=replace(made.plant_, dead_time_s=late_s, ci95=ends))
    read = [one for one in shown.findings if one.code in AS_READ]
    told = ranked((*_today_findings(rig, steps["Ts"], known), *moved, *read, *stops(shown.findings)))
    made = replace(made, data=data, uncertainty=uncertainty, findings=told, responses=tuple(held))
    replayed = () if isinstance(step, Fit) else of_own_logs(made, step.logs)
    return replace(made, parameters=parameters_of(made), data=replace(data, replayed=replayed))


def plant_in_steps(rig: Rig, base: Fit, shown: Fit) -> tuple[float | None, list[Finding]]:
    """What reference steps show of the plant that no T_s tells: a dead time other than its own [s], None where it is
    that; with what is said of it, and of a τ1 that none of the sessions makes likely."""
    if base.plant_ is None or base.plant.zeta is not None:
        return None, []
    late_s, found, plant = None, dict[str, Finding](), base.plant
    steps = {one.level: one for one in values_of_fit(shown, "tau1", "")}
    for row in shown.friction_levels:
        own, one = float(plant.time_constants(row.level)[0]), steps.get(row.level)
        if late_s is None and abs(row.delay_s - plant.dead_time_s) > LATE_PART * own:
            late_s, known_s = row.delay_s, plant.dead_time_s
            found["dead time"] = finding("plant-moved", "today", what="dead time", a=late_s, b=known_s, unit=" s")
        if one is None:
            continue
        if "tau1" in rig.quantities:
            next_one = rig.foreseen(np.array([row.level]), quantity="tau1")
            own = float(next_one.value[0])
            low, high = next_one.of_a_run(max(rig.quantities["tau1"].sd_step, one.sd_log) ** 2)
        else:
            reach = TAU_SCATTER * np.exp(stdtrit(one.dof, 0.975) * one.sd_log)
            low, high = own / reach, own * reach
        if not low < row.tau1 < high:
            slow = finding("plant-moved", "today", what=f"τ1 at {row.level:.4g}", a=row.tau1, b=own, unit=" s")
            found.setdefault("tau1", slow)
    return late_s, list(found.values())


def _fitted(base: Fit, steps: StepSet) -> Fit:
    models = ("friction", "linear") if steps.kind == "clutch" else ("friction",)
    given = {**part(FitOptions, base.options).given(), "model": models, "hold_out": (), "bounds_levels": None}
    fitted = on_plant(base, fit_steps(steps, given_options(FitOptions, None, given)), steps)
    return replace(fitted, responses=responses_of(steps, fitted.findings))


def on_plant(base: Fit, shown: Fit, steps: StepSet) -> Fit:
    """A fit of steps with T_s of each level as the lags of a rig that is no clutch make it: its plant's response, with
    the gain that is nearest to the step, known as the noise of what that leaves tells; but of an overshoot, and lags
    over the input, at the pace that is nearest, which becomes that of its plant."""
    if (part := base.another_plant) is None or shown.friction is None:
        return shown
    means, rows = {level.level: (level.time_s, level.mean) for level in steps.levels}, []
    free, paces = part.kind in ("lag", "series", "ringing") and not part.paced, list[tuple[float, float]]()
    for row in shown.friction.levels:
        if row.from_ == 0 and row.Ts and row.level in means:
            plant = plain_replace(part.plant, dead_time_s=row.delay_s if part.dead_time_s > 0 else 0.0)
            gain, pace, sd = _gain_and_pace(plant, row.level, *means[row.level], free=free)
            own = {"Ts": (gain * float(part.plant.steady(row.level)), sd[0] / max(abs(gain), 1e-300))}
            if free:
                paces.append((sd[1], pace))
                own["tau1"] = float(np.exp(pace)) * float(part.plant.time_constants(row.level)[0]), sd[1]
            ends = {name: log_interval_of(value, sd_log**2, np.inf) for name, (value, sd_log) in own.items()}
            ci95 = replace(row.ci95 or LevelIntervals(), **ends)
            row = replace(row, **{name: value for name, (value, _) in own.items()}, ci95=ci95)
        rows.append(row)
    paced = _at_pace(part, *min(paces)) if paces else None
    return replace(shown, friction=replace(shown.friction, levels=tuple(rows)), plant_=paced)


def _gain_and_pace(
    plant: Plant, level: float, time_s: Array, y: Array, free: bool
) -> tuple[float, float, list[float]]:  # fmt: skip
    """The gain that brings a plant's response nearest to a step, the logarithm of the factor on its time constants that
    does (0 where that is not `free`), and the standard deviations of these."""

    def response(pace: float) -> Array:
        return from_rest(_paced(plant, pace), time_s, level)

    def left(pace: float) -> float:
        f = response(pace)
        return float(np.sum((y - best_gain(f, y) * f) ** 2))

    pace = 0.0
    if free:
        tried = np.linspace(-FARTHEST_PACE, FARTHEST_PACE, PACES_TRIED)
        near = float(tried[np.argmin([left(one) for one in tried.tolist()])])
        about = near + np.array([-1.0, 1.0]) * (tried[1] - tried[0])
        pace = float(minimize_scalar(left, bounds=about.tolist(), method="bounded", options={"xatol": 1e-6}).x)
    J = [f := response(pace)]
    gain = best_gain(f, y)
    if free:
        J.append(gain * (response(pace + PACE_STEP) - response(pace - PACE_STEP)) / (2 * PACE_STEP))
    moved = np.linalg.pinv(np.stack(J, axis=1)) * (y - gain * f)
    return gain, pace, np.sqrt(bartlett_variance(time_s, moved.T).max(axis=0)).tolist()


def _paced(plant: Plant, pace: float) -> Plant:
    """A plant whose time constants are e^pace times as long."""
    tau1, tau2 = (tuple(float(np.exp(pace)) * one for one in tau) for tau in (plant.tau1, plant.tau2))
    return plain_replace(plant, tau1=tau1, tau2=tau2)


def _at_pace(part: FittedPlant, sd: float, pace: float) -> FittedPlant:
    """A plant with the pace of a step, and the lags' intervals by that."""
    own, names = _paced(part.plant, pace), set(names_of(part.plant)) & {"tau1", "tau2", "omega"}
    ends: dict[str, Any] = {
        name: log_interval_of(number_at(own, name, part.u_range[1]), sd**2, np.inf) for name in names
    }
    return replace(part, tau1=own.tau1, ci95=PlantIntervals(**ends))


def _steps(rig: Rig, shown: Fit, name: str) -> KnownValues:
    """What the reference steps say of a number: known no better than so many runs are, however quiet one is. Of a0 of
    one level, and of a damping, nothing: it is another number than that of all."""
    if name in WHOLE_NUMBERS and name != "omega":
        return NO_STEPS
    values, data = values_of_fit(shown, name, "", of_one_run=name in ("Ts", *RESPONSES)), shown.data
    known = []
    for one in values:
        k = data.levels.index(one.level) if one.level in data.levels else None
        runs, hold_s = (1, np.inf) if k is None else (max(data.repeats[k], 1), data.record_s[k])
        sd = max(rig.quantities[name].sd_step / runs**0.5, one.sd_log)
        ahead = _still_to_come(rig, one.level, hold_s) if name == "Ts" else 0.0
        known.append((one.level, one.value, float(np.hypot(sd, ahead))))
    return steps_known(known)


def _still_to_come(rig: Rig, level: float, hold_s: float) -> float:
    """How sure a hold that ends before the slow part has come is of ln T_s: half of what was still to come, by the
    plant of the sessions."""
    base = rig.base
    if base is None or (base.plant_ is None and base.nonlinear is None):
        return 0.0
    plant = base.plant
    if plant.C >= 1 or plant.zeta is not None:
        return 0.0
    return 0.5 * (1 - plant.C) * float(decay(np.array(hold_s), plant.time_constants(level)[1]))


def _today_findings(rig: Rig, steps: KnownValues, foreseen: NextByName) -> list[Finding]:
    """How sure today is, a step beyond what was foreseen, what is taken from the base, a level beyond the sessions'."""
    one, model, after = rig.main, rig.main.model(rig.names), float(np.exp(foreseen["Ts"].reach.max()))
    found = [
        finding("for-today", "sessions", sessions=model.count, steps=len(steps.y), factor=after, without=one.factor)
    ]
    if after > HARDLY_SURER * one.factor:
        found.append(finding("steps-tell-alone", "sessions"))
    found += [each for each in rig.findings if each.code == "levels-and-sessions-confounded"]
    for level, y, W in zip(steps.level.tolist(), steps.y, steps.W, strict=True):
        if not model.knots[0] <= level <= model.knots[-1]:
            found.append(finding("reference-level-outside", "sessions", model.knots, level=level, unit=rig.input_unit))
        ahead = model.next(np.array([level]))
        (low, high), middle, value = ahead.of_a_run(W), float(ahead.value[0]), float(np.exp(y))
        code, pct = "step-foreseen" if low <= value <= high else "step-outside", 100 * (value / middle - 1)
        units = {"unit": one.unit, "unit_in": rig.input_unit}
        found.append(
            finding(code, "sessions", [level], value=value, middle=middle, low=low, high=high, pct=pct, **units)
        )
    part = None if rig.base is None else rig.base.another_plant
    names = ("tau1", "tau2") if part is None else names_of(part.plant)
    kept = tuple(name for name in names if name not in foreseen)
    return [*found, finding("kept-from-base", "sessions", parameters=kept)] if kept else found


def _at(foreseen: NextByName, names: Sequence[str], k: int) -> tuple[dict[str, float], dict[str, Any]]:
    """Of what the sessions know of some numbers: values at level k, and their ends, with the degrees of freedom."""
    known = {name: foreseen[name] for name in names if name in foreseen}
    ends = {name: tuple(one.ends[:, k].tolist()) for name, one in known.items()}
    dof = {name: float(one.dof[k]) for name, one in known.items()}
    return {name: float(one.value[k]) for name, one in known.items()}, {**ends, "dof": dof}


def _with_levels(base: Fit, rows: Sequence[Any], foreseen: NextByName) -> Fit:
    """The fit with the foreseen values as those of its levels."""
    if base.friction is None:
        return base
    levels = []
    for k, row in enumerate(rows):
        values, ends = _at(foreseen, CURVES_ORDER, k)
        own = {name: values.get(name, getattr(row, name)) for name in CURVES_ORDER}
        own["tau2"] = max(own["tau1"], own["tau2"])
        C_f = row.C_f and row.C_f * own["Ts"] / row.Ts
        levels.append(replace(row, **own, ci95=LevelIntervals(**ends), C_f=C_f, **NOT_FITTED))
    return replace(base, friction=parts.Friction(base.friction.C, base.friction.over, tuple(levels)))


def _with_plant(base: Fit, rows: Sequence[Any], foreseen: NextByName, of_all: NextByName) -> Fit:
    """The fit with its plant's curves put through the foreseen values, and the covariance of these; of another kind
    with the numbers `of_all` levels."""
    plant, model = base.plant_ or base.nonlinear, base.nonlinear
    if plant is None:
        return base
    levels = np.array([row.level for row in rows])
    inputs = np.union1d(levels, np.linspace(levels[0], levels[-1], INPUTS_DRAWN))
    hats, u_range = between(levels, inputs), plant.u_range
    curves: dict[str, tuple[float, ...]] = {}
    blocks: dict[str, Array] = {}
    for name in CURVES_ORDER:
        count = len(getattr(plant, name))
        own, blocks[name] = np.array(getattr(plant, name)) * scales(count), np.zeros((count, count))
        value = terms(inputs, count, u_range) @ own if count else np.zeros(1)
        if name not in foreseen or not (value > 0).all():
            continue
        back = np.linalg.pinv(terms(inputs, count, u_range) / value[:, None])
        moved = np.exp(hats @ (foreseen[name].mean - np.log(terms(levels, count, u_range) @ own)))
        curves[name] = tuple((back @ moved / scales(count)).tolist())
        turn = back @ (moved[:, None] * hats)
        blocks[name] = turn @ foreseen[name].covariance @ turn.T
    foretold = tuple(zip(levels.tolist(), foreseen["Ts"].value.tolist(), strict=True))
    through = foretold if plant.Ts_through else ()
    if (part := base.plant_) is not None:
        each = foretold if part.Ts_levels else ()
        whole = _lags_of_another_kind(of_all) if part.another else {}
        known = _of_another_kind(part, rows, foreseen, of_all) if part.another else None
        base = replace(base, plant_=replace(part, ci95=known, Ts_through=through, Ts_levels=each, **curves | whole))
    if model is None:
        return base
    own_curves = {name: getattr(model, name) for name in CURVES_ORDER} | curves
    kept = {name: getattr(model, name) for name in ("C", "solver", "estimator")}
    plain = parts.Nonlinear(**own_curves, **kept, u_range=u_range, Ts_through=through)
    by_level = [(row.level, *_at(foreseen, CURVES_ORDER, k)) for k, row in enumerate(rows)]
    shown = [parts.CurveLevel(u, **values, ci95=LevelIntervals(**ends)) for u, values, ends in by_level]
    degrees = {name: median(foreseen[name].dof) if name in foreseen else MANY for name in CURVES_ORDER}
    return replace(base, nonlinear=with_intervals(plain, shown, block_diag(*blocks.values()), degrees))


def _of_another_kind(
    part: FittedPlant, rows: Sequence[Any], foreseen: NextByName, of_all: NextByName
) -> PlantIntervals:  # fmt: skip
    """The intervals of a plant that is no clutch: those of the next session where it is foreseen, else of the base."""
    before, by_level = part.ci95 or PlantIntervals(), dict[str, tuple[tuple[float, float, float], ...]]()
    for name in ("Ts", "tau1"):
        if (one := foreseen.get(name)) is not None:
            by_level[name] = tuple((row.level, *ends) for row, ends in zip(rows, one.ends.T.tolist(), strict=True))
    top, low, high = by_level["Ts"][-1]
    tau1 = by_level["tau1"][-1][1:] if "tau1" in by_level else before.tau1
    own = {"tau1": tau1} | {name: tuple(one.ends[:, 0].tolist()) for name, one in of_all.items() if name != "a0"}
    return replace(before, gain=(low / top, high / top), levels={**before.levels, **by_level}, **own)


def _lags_of_another_kind(of_all: NextByName) -> dict[str, Any]:
    """What of a plant that is no clutch is foreseen as a whole: ω and ζ, also of two lags in series; a dead time."""
    value = {name: float(one.value[0]) for name, one in of_all.items()}
    found: dict[str, Any] = {name: value[name] for name in ("zeta", "dead_time_s") if name in value}
    if "omega" in value:
        found["tau1"] = (1 / value["omega"],)
    if "tau1" in value and "tau2" in value:
        root, mean = (value["tau1"] * value["tau2"]) ** 0.5, (value["tau1"] + value["tau2"]) / 2
        found |= {"tau1": (root,), "zeta": mean / root}
    return found


def _with_linear(base: Fit, rows: Sequence[Any], foreseen: NextByName, a0: Next | None) -> Fit:
    """The fit with a linear model whose gain follows T_s, and with B of the next session; where sessions do not know B,
    which goes with τ1/T_s, as T_s and its interval, and τ1 where they know that, make it."""
    old = base.linear
    if old is None or not old.a0 > 0:
        return base
    Ts, tau1, before = foreseen["Ts"], foreseen.get("tau1"), {row.level: row for row in old.per_level}
    level, moved = [], []
    for k, row in enumerate(rows):
        if row.level not in before or not (own_B := before[row.level].B):
            continue
        slower = 1.0 if tau1 is None else float(tau1.value[k]) / row.tau1
        gain = before[row.level].gain * float(Ts.value[k]) / row.Ts
        if (B := foreseen.get("B")) is not None:
            one, (low, high), dof = float(B.value[k]), B.ends[:, k].tolist(), float(B.dof[k])
        else:
            one, *_ = values = [own_B * slower * row.Ts / of for of in (Ts.value[k], *Ts.ends[::-1, k])]
            (low, high), dof = map(float, values[1:]), float(Ts.dof[k])
        ends = parts.LinearLevelIntervals(B=(low, high), dof={"B": dof})
        level.append(parts.LinearLevel(row.level, row.level / (one * gain), gain, 1 / one, 0.0, one, ci95=ends))
        moved.append(gain - before[row.level].gain)
    if not level:
        return base
    at = [one.level for one in level]
    slope, offset = np.polyfit(at, moved, 1).tolist() if len(at) > 1 else (moved[0] / at[0], 0.0)
    kept = old.bounds.levels if old.bounds is not None else tuple(at)
    inside = [one.ci95.B for one in level if one.level in kept and one.ci95 is not None and one.ci95.B is not None]
    value, ci95 = old.a0, parts.PooledIntervals()
    if a0 is not None:
        value, (low, high) = float(a0.value[0]), a0.ends[:, 0].tolist()
        ci95 = parts.PooledIntervals(a0=(low, high), dof={"a0": float(a0.dof[0])})
    linear = parts.Linear(
        value, value * (old.b0 / old.a0 + slope), value * (old.c0 / old.a0 + offset), old.solver, ci95, tuple(level),
        parts.Bounds(levels=kept, B_m=min(one[0] for one in inside), B_M=max(one[1] for one in inside)),
    )  # fmt: skip
    return replace(base, linear=linear)
