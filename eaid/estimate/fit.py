"""StepSet → Fit: the models that the kind of experiment allows, with held-out levels and loss.

Intervals and the choice between estimates follow in `eaid.estimate.workflow`.
"""

from collections.abc import Sequence
from dataclasses import asdict, replace

import msgspec
import numpy as np

from eaid.errors import DataError, UsageError
from eaid.estimate.data import data_of
from eaid.estimate.friction import fit_curves, friction_fit, friction_hold_out, missed_levels
from eaid.estimate.huber import huber_findings, with_runs
from eaid.estimate.joint import nonlinear_fit
from eaid.estimate.linear import linear_fit
from eaid.estimate.release import release_fit
from eaid.findings import finding, ranked
from eaid.models.parameters import SHARE
from eaid.options import MODELS, FitOptions
from eaid.results.common import Input, Source
from eaid.results.fit import Fit, FittedData, Rig
from eaid.steps.stepset import Level, StepSet

ALLOWED: dict[str, tuple[str, ...]] = {
    "clutch": MODELS,
    "friction-force": ("friction",),
    "friction-speed": ("friction",),
}
"""Models that a kind of experiment can be fitted with."""


def fit(stepset: StepSet, options: FitOptions | None = None) -> Fit:
    """Fit what the kind of experiment allows; raises DataError or UsageError where that is nothing.

    The nonlinear model is the joint estimate here; no part has intervals yet.
    """
    options = options or FitOptions()
    if not stepset.levels:
        raise DataError("no rising step was found in the logs; give «step_at», or check the input column")
    models = chosen(stepset.kind, options.model)
    kept, held_out = split(stepset.levels, options.hold_out)
    whole, stepset = stepset, replace(stepset, levels=kept)
    data = data_of(kept)
    curves, huber = fit_curves(data, options)
    found = [finding("curve-explains-little", "friction", little)] if (little := missed_levels(curves, data)) else []
    result = Fit(data=data_part(whole))
    if "friction" in models:
        part, more = friction_fit(stepset, curves, options.held_share)
        beyond = friction_hold_out(part, stepset, held_out)
        part = msgspec.structs.replace(part, robust=with_runs(huber, kept), hold_out=beyond)
        result, found = msgspec.structs.replace(result, friction=part), [*found, *more]
        found += huber_findings("friction", huber)
    if "nonlinear" in models:
        model, more = nonlinear_fit(data, options, held_out)
        model = msgspec.structs.replace(model, robust=with_runs(model.robust, kept))
        result, found = msgspec.structs.replace(result, nonlinear=model), [*found, *more]
    if "linear" in models:
        pooled, more = linear_fit(data, options, held_out)
        pooled = msgspec.structs.replace(pooled, robust=with_runs(pooled.robust, kept))
        result, found = msgspec.structs.replace(result, linear=pooled), [*found, *more]
    if stepset.releases:
        held_s = {level.level: float(level.time_s[-1]) for level in kept}
        release, more = release_fit(stepset.releases, curves, held_s, options.held_share or SHARE)
        result, found = msgspec.structs.replace(result, release=release), [*found, *more]
    return msgspec.structs.replace(result, findings=ranked(found), converged=converged(result))


def converged(result: Fit) -> bool:
    """Whether every model that was fitted passed our verdict."""
    parts = (result.friction, result.nonlinear, result.linear, result.release)
    return all(part.solver is None or part.solver.converged for part in parts if part is not None)


def chosen(kind: str, wanted: Sequence[str] | None) -> tuple[str, ...]:
    """The models to fit; raises UsageError for one that the kind does not allow."""
    allowed = ALLOWED[kind]
    for name in wanted or ():
        if name not in allowed:
            raise UsageError(f"«model» {name}: {kind} logs can be fitted with {', '.join(allowed)}")
    return tuple(name for name in allowed if wanted is None or name in wanted)


def split(levels: Sequence[Level], hold_out: Sequence[float]) -> tuple[tuple[Level, ...], tuple[Level, ...]]:
    """The levels to fit and those held out; raises UsageError where a held-out level is not there."""
    there = [level.level for level in levels]
    for wanted in hold_out:
        if not any(np.isclose(wanted, level) for level in there):
            raise UsageError(f"«hold_out» {wanted:g}: no such level; there are {', '.join(f'{u:g}' for u in there)}")
    held = tuple(level for level in levels if any(np.isclose(level.level, u) for u in hold_out))
    kept = tuple(level for level in levels if not any(np.isclose(level.level, u) for u in hold_out))
    if not kept:
        raise UsageError("«hold_out»: every level is held out; leave some to be fitted")
    return kept, held


def data_part(stepset: StepSet) -> FittedData:
    """What a fit is made from: kind, units, levels, the rig and the runs."""
    rates = [run.rate_hz for run in stepset.runs if not run.left_out]
    if not rates:
        rates = [(len(level.time_s) - 1) / float(level.time_s[-1] - level.time_s[0]) for level in stepset.levels]
    return FittedData(
        kind=stepset.kind,  # type: ignore[arg-type]  # one of the three
        input_unit=stepset.input_unit,
        output_unit=stepset.output_unit,
        levels=tuple(level.level for level in stepset.levels),
        repeats=tuple(len(level.runs) for level in stepset.levels),
        samples=tuple(len(level.time_s) for level in stepset.levels),
        record_s=tuple(float(level.time_s[-1]) for level in stepset.levels),
        sample_rate_hz=max(rates, default=None),
        apparatus=Rig(**asdict(stepset.apparatus)),
        sources=tuple(
            Source(
                run.source,
                run.sha256,
                run.name,
                run.level,
                run.repeat,
                run.baseline_nm,
                run.step_s,
                run.samples,
                run.edge,
            )
            for run in stepset.runs
            if not run.left_out
        ),
        inputs=tuple(Input(path, sha256) for path, sha256 in stepset.inputs),
        synthetic=stepset.synthetic,
    )
