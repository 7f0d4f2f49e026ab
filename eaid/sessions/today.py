"""`today`: one or two reference steps of a new session → a fit whose intervals are those of the next session.

T_s, τ1, τ2 and B are foreseen at the levels of the session with the most of them (`base`), given the steps. Each of its
curves p(u) is put through p(u) e^d(u), d the logarithm of the foreseen over its own, straight in ln u between levels,
by least squares of the relative error; its coefficients get the covariance by which the foreseen values go together,
so that drawn plants are those of the next session. B_m and B_M are the outermost ends of the levels' intervals of B.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
from scipy.linalg import block_diag

from eaid.arrays import Array
from eaid.declared import chosen, part
from eaid.errors import DataError
from eaid.estimate.coefficients import BLOCKS, with_intervals
from eaid.estimate.workflow import fit_steps
from eaid.findings import Finding, finding, ranked
from eaid.options import FitOptions, ReadOptions
from eaid.plant.forms import scales, terms
from eaid.results import fit as parts
from eaid.results.fit import Fit, LevelIntervals
from eaid.results.parameters import table_of
from eaid.results.plant import FittedPlant
from eaid.sessions.gather import together, values_of
from eaid.sessions.model import NOTHING, Known, Next, between, steps_known
from eaid.sessions.rig import Rig

if TYPE_CHECKING:
    from eaid.steps.stepset import StepSet

INPUTS = 11  # Over the range, beside the levels, through which a curve is put
CI = "sessions"  # What a fit of today says its intervals are made of


def reading_of(rig: Rig, given: ReadOptions | None) -> ReadOptions:
    """How reference steps are read: as the logs of the sessions, but for what is given."""
    before = rig.base.options.reading if rig.base is not None else {}
    kept = {name: value for name, value in before.items() if name not in ("levels", "repair")}
    return chosen(ReadOptions, None, {**kept, **(given.stated() if given is not None else {})})


def today(rig: Rig, step: "StepSet | Fit") -> Fit:
    """`eaid.today` on steps that were read; DataError for a rig of a plain table, or steps of another rig."""
    base = rig.base
    if base is None:
        raise DataError("the rig is of a plain table and holds no plant; its `next(steps=…)` says what today's may be")
    shown = step if isinstance(step, Fit) else _fitted(base, step)
    logs = {one.sha256: session.name for session in rig.sessions for one in session.logs if one.sha256}
    for one in shown.data.sources:
        if one.sha256 in logs:
            raise DataError(f"{one.path}: is a log of session {logs[one.sha256]} already; give a step of the new session")
    together({"the rig": msgspec.structs.replace(base, data=msgspec.structs.replace(base.data, sources=())), "today":
              msgspec.structs.replace(shown, data=msgspec.structs.replace(shown.data, sources=()))})  # fmt: skip
    steps = {name: _steps(rig, shown, name) for name in rig.quantities}
    if not len(steps["Ts"].y):
        raise DataError("no reference step has a T_s above 0; record one whose output rises")
    rows = [row for row in base.friction_levels if row.from_ == 0] or list(base.nonlinear.curves if base.nonlinear else ())
    levels = np.array([row.level for row in rows])
    foreseen = {name: rig.foreseen(name, levels if name != "a0" else np.ones(1), steps[name]) for name in rig.quantities}
    made = _with_levels(base, rows, foreseen)
    made = _with_linear(_with_plant(made, levels, rows, foreseen), rows, foreseen)
    uncertainty = made.uncertainty or parts.Uncertainty()
    data = msgspec.structs.replace(
        base.data, sources=shown.data.sources, inputs=shown.data.inputs, repeats=(), samples=(),
        synthetic=shown.data.synthetic or base.data.synthetic,
    )  # fmt: skip
    made = msgspec.structs.replace(
        made, data=data, uncertainty=msgspec.structs.replace(uncertainty, ci=CI, share=None, lack_of_fit=()),
        findings=ranked((*_told(rig, steps["Ts"], foreseen), *(one for one in shown.findings if one.severity == "stop"))),
    )  # fmt: skip
    return msgspec.structs.replace(made, parameters=table_of(made))


def _fitted(base: Fit, steps: "StepSet") -> Fit:
    models = ("friction", "linear") if steps.kind == "clutch" else ("friction",)
    kept = {"model": models, "hold_out": (), "bounds_levels": None}
    return fit_steps(steps, chosen(FitOptions, None, {**part(FitOptions, base.options).given(), **kept}))


def _steps(rig: Rig, shown: Fit, name: str) -> Known:
    """What the reference steps say of a number: known no better than so many runs are, however quiet one is."""
    if name == "a0":  # of one level it is another number than of all
        return NOTHING
    single, of = rig.quantities[name].sd_step, {one.level: one.sd_log for one in values_of(shown, name, "today")}
    repeats = dict(zip(shown.data.levels, shown.data.repeats, strict=False))
    if name == "Ts":  # of one quiet run there may be no interval
        rows = [(row.level, row.Ts) for row in shown.friction_levels if row.from_ == 0 and row.Ts > 0]
    else:
        rows = [(one.level, one.value) for one in values_of(shown, name, "today")]
    if not rows:
        return NOTHING
    own = [max(of.get(level, 0.0), single / max(repeats.get(level, 1), 1) ** 0.5) for level, _ in rows]
    return steps_known(*zip(*rows, strict=True), own)


def _told(rig: Rig, steps: Known, foreseen: Mapping[str, Next]) -> list[Finding]:
    """How sure today is, a step beyond what was foreseen, what is taken from the base, a level beyond the sessions'."""
    one, model, unit = rig.main, rig.model(), rig.input_unit
    after = float(np.exp(foreseen["Ts"].reach.max()))
    found = [finding("for-today", "sessions", sessions=model.count, steps=len(steps.y), factor=after, without=one.factor)]
    for k, level in enumerate(steps.level.tolist()):
        if not model.knots[0] <= level <= model.knots[-1]:
            found.append(finding("reference-level-outside", "sessions", model.knots, level=level, unit=unit))
        before = model.next(np.array([level]))
        reach = float(before.reach[0] * np.sqrt(1 + steps.W[k] / before.covariance[0, 0]))
        if abs(steps.y[k] - before.mean[0]) > reach:
            ends = np.exp(before.mean[0] + reach * np.array([-1.0, 1.0])).tolist()
            found.append(finding("step-outside", "sessions", [level], parameter="Ts", value=float(np.exp(steps.y[k])),
                                 unit=one.unit, low=ends[0], high=ends[1]))  # fmt: skip
    if kept := tuple(name for name in ("tau1", "tau2") if name not in foreseen):
        found.append(finding("kept-from-base", "sessions", parameters=kept))
    return found


def _at(foreseen: Mapping[str, Next], name: str, k: int) -> tuple[float, tuple[float, float], float] | None:
    """Value, interval and degrees of freedom of a number at level k; None where the sessions do not know it."""
    if name not in foreseen:
        return None
    low, high = foreseen[name].ends[:, k].tolist()
    return float(foreseen[name].value[k]), (low, high), float(foreseen[name].dof[k])


def _intervals(foreseen: Mapping[str, Next], k: int) -> tuple[dict[str, float], LevelIntervals]:
    known = {name: one for name in BLOCKS if (one := _at(foreseen, name, k)) is not None}
    ends, dof = {name: one[1] for name, one in known.items()}, {name: one[2] for name, one in known.items()}
    return {name: one[0] for name, one in known.items()}, LevelIntervals(**ends, dof=dof)


def _with_levels(base: Fit, rows: Sequence[Any], foreseen: Mapping[str, Next]) -> Fit:
    """The fit with the foreseen values as those of its levels."""
    if base.friction is None:
        return base
    levels = []
    for k, row in enumerate(rows):
        values, ends = _intervals(foreseen, k)
        own = {name: values.get(name, getattr(row, name)) for name in BLOCKS}
        own["tau2"] = max(own["tau1"], own["tau2"])
        factor = own["Ts"] / row.Ts if row.Ts else 1.0
        levels.append(
            parts.FrictionLevel(level=row.level, C=row.C, delay_s=row.delay_s, stress_kpa=row.stress_kpa, ci95=ends,
                                speed_rpm=row.speed_rpm, C_f=row.C_f and factor * row.C_f, **own)
        )  # fmt: skip
    friction = parts.Friction(base.friction.C, base.friction.over, tuple(levels))
    return msgspec.structs.replace(base, friction=friction)


def _with_plant(base: Fit, levels: Array, rows: Sequence[Any], foreseen: Mapping[str, Next]) -> Fit:
    """The fit with its plant's curves put through the foreseen values, and their covariance."""
    plant = base.plant_ or (FittedPlant.of(base.plant, (base.data.input_unit, base.data.output_unit))
                            if base.nonlinear is not None else None)  # fmt: skip
    if plant is None:
        return base
    inputs = np.union1d(levels, np.linspace(levels[0], levels[-1], INPUTS))
    blocks: dict[str, Array] = {}
    curves: dict[str, tuple[float, ...]] = {}
    for name in BLOCKS:
        own = np.array(getattr(plant, name)) * scales(len(getattr(plant, name)))
        blocks[name] = np.zeros((len(own), len(own)))
        design = terms(inputs, len(own), plant.u_range)
        value = design @ own
        if name not in foreseen or not len(own) or not (value > 0).all():
            continue
        back, hats = np.linalg.pinv(design / value[:, None]), between(levels, inputs)
        moved = foreseen[name].mean - np.log(terms(levels, len(own), plant.u_range) @ own)
        curves[name] = tuple((back @ np.exp(hats @ moved) / scales(len(own))).tolist())
        turn = back @ (np.exp(hats @ moved)[:, None] * hats)
        blocks[name] = turn @ foreseen[name].covariance @ turn.T
    made = msgspec.structs.replace(base, plant_=msgspec.structs.replace(plant, ci95=None, **curves))
    model = base.nonlinear
    if model is None:
        return made
    plain = parts.Nonlinear(**{**{name: getattr(model, name) for name in BLOCKS}, **curves}, u_range=model.u_range,
                            C=model.C, solver=model.solver, estimator=model.estimator)  # fmt: skip
    shown = [parts.CurveLevel(row.level, **_intervals(foreseen, k)[0], ci95=_intervals(foreseen, k)[1])
             for k, row in enumerate(rows)]  # fmt: skip
    degrees = {name: float(np.median(foreseen[name].dof)) if name in foreseen else 1e9 for name in BLOCKS}
    whole = block_diag(*(blocks[name] for name in BLOCKS))
    return msgspec.structs.replace(made, nonlinear=with_intervals(plain, shown, whole, degrees))


def _with_linear(base: Fit, rows: Sequence[Any], foreseen: Mapping[str, Next]) -> Fit:
    """The fit with a linear model whose gain follows T_s, and with B of the next session."""
    old = base.linear
    if old is None or "B" not in foreseen or "a0" not in foreseen:
        return base
    before, level, low_high = {row.level: row for row in old.per_level}, [], []
    for k, row in enumerate(rows):
        B, one = _at(foreseen, "B", k), before.get(row.level)
        if B is None or one is None:
            continue
        gain = one.gain * float(foreseen["Ts"].value[k]) / row.Ts
        ends = parts.LinearLevelIntervals(B=B[1], dof={"B": B[2]})
        level.append(parts.LinearLevel(row.level, row.level / (B[0] * gain), gain, 1 / B[0], 0.0, B[0], True, ends))
        low_high.append(B[1])
    kept = old.bounds.levels if old.bounds is not None else ()
    inside = [(one, ends) for one, ends in zip(level, low_high, strict=True) if one.level in kept or not kept]
    if not inside:
        return base
    moved = [one.gain - before[one.level].gain for one in level]
    at = [one.level for one in level]
    slope, offset = np.polyfit(at, moved, 1) if len(at) > 1 else (moved[0] / at[0], 0.0)
    value, ends, dof = _at(foreseen, "a0", 0) or (old.a0, None, 0.0)
    pooled = parts.PooledIntervals(a0=ends, dof={"a0": dof})
    linear = parts.Linear(
        value, value * (old.b0 / old.a0 + float(slope)), value * (old.c0 / old.a0 + float(offset)), old.solver, pooled,
        tuple(level), parts.Bounds("zero-offset", tuple(one.level for one, _ in inside),
                                   min(ends[0] for _, ends in inside), max(ends[1] for _, ends in inside)),
    )  # fmt: skip
    return msgspec.structs.replace(base, linear=linear)
