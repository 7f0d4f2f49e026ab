"""Steps from rest whose rig is no clutch: the plant of another kind in the place of the clutch's, where evidence asks.

Their mean curves are fitted as logs, of every kind; one takes the clutch's place where that must not be used, where its
two lags are one, or where another swings and explains far more.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np

from eaid.arrays import best_gain, median, white_squares
from eaid.errors import DataError
from eaid.estimate import forms
from eaid.estimate.recorded_log import RecordedLog, add_rest, logs_of_steps
from eaid.findings import merged, ranked
from eaid.levels.asks import asks_for_one_lag, never_slow
from eaid.levels.from_steps import ENDLESS_RECORDS
from eaid.levels.release import release_of
from eaid.levels.workflow import usual_idle
from eaid.options import FitOptions
from eaid.plant.forms import PerLevel
from eaid.plant.respond import from_rest
from eaid.recorded.beside import choose_plant
from eaid.recorded.choice import choose_kind, squares_about_mean, subtract_white_noise
from eaid.recorded.clutch_form import Chosen
from eaid.recorded.engagements import without_gains
from eaid.recorded.fit import experiment_of, fit_of
from eaid.recorded.from_logs import fit_through, setup_of
from eaid.recorded.inputs import Experiment
from eaid.recorded.kinds import solve_gain
from eaid.recorded.plant_part import levels_of_plant
from eaid.results.fit import Fit
from eaid.results.models import Noise
from eaid.results.verdict import judged
from eaid.shapes.delay import cut_behind
from eaid.steps.stepset import StepSet, as_late

REST_ROWS = 20  # Before a step
OF_PLANT = ("kind-by-evidence", "dead-time", "levels-scatter", "output-levels-off")  # Which go with a plant
# No step has its shape
OF_SHAPES = {
    "dead-time", "input-late", "other-shape-fits-better", "shape-explains-little", "shape-misses", "step-leaves-open"
}  # fmt: skip
SURELY_BETTER = 0.9  # Score of another kind over that of one lag, from which on it is taken for that
FAR_BETTER = 0.7  # Of what the clutch leaves, another kind leaves this much at most to be taken: half of the squares
FAR_OFF_PCT = 3.0  # Of the fit that one lag lacks, from which on it is not asked again
AS_WELL_PCT = 1.0  # Of the fit that another kind may lose against two lags that meet
# What it leaves of the steps' shapes over what these leave, at most; and beside a slow part that comes at no level, as
# that imitates a drift
AS_WELL_SHAPED, AS_WELL_ALONE = 1.1, 3.0
MUST_EXPLAIN_PCT = 80.0  # Of steps that another kind has to explain before it takes the clutch's place


def try_another_kind(fit: Fit, stepset: StepSet, options: FitOptions, late_s: float = 0.0) -> Fit:
    """A fit of steps whose clutch must not be used with the plant of another kind, where that explains the steps; or
    whose two lags meet, or behind a peak, where one explains as much, or another kind far more."""
    if not stepset.levels or options.model is not None or options.holds_curve:
        return fit
    late_s = late_s or fit.noted_late_s
    stepset = stepset.noted_late(late_s)
    # behind the rest lies a dead time, or in it what an input that was noted late did
    logs = [replace(add_rest(log, REST_ROWS), source="") for log in logs_of_steps(stepset)]
    how = replace(options, ci="none" if options.ci == "none" else "robust")
    one = "lag+dead" if fit.dead_time_s > 0 else "lag"
    try:
        experiment = experiment_of(logs, how, repeats=stepset.levels, falls=False)
        chosen, of_evidence = choose_beside_gains(experiment), None
        for kind in ("", one):  # the one of evidence; then the one that the two lags became
            if kind:
                of_lag = max((row.fit_pct or 0.0 for row in chosen.kinds if row.kind == one), default=0.0)
                if not asks_for_one_lag(fit) or of_lag < explained_pct(fit, logs, False) - FAR_OFF_PCT:
                    break
                chosen = chosen if chosen.searched is None else choose_kind(chosen.searched, kind)
            if chosen.of_clutch:
                continue
            chosen = fit_levels_each(chosen, experiment.logs)
            other = fit_of(experiment, chosen)
            if not kind and len(stepset.levels) > 1:  # the shape of one step alone is a dead time's, too
                of_evidence = other
            if takes_its_place(other, fit, logs):
                if of_evidence is not None and explains_more(of_evidence, chosen):  # than the one lag, which would do
                    other = of_evidence
                if other.noted_late_s and not late_s:  # its holds end before the fall that came as early
                    return try_another_kind(fit, stepset, options, other.noted_late_s)
                return put_in_its_place(other, fit, stepset)
    except DataError:  # what short windows of steps show is no reason to refuse them
        return fit
    return fit


def choose_beside_gains(experiment: Experiment) -> Chosen:
    """The plant of steps, chosen as if their levels had the gains that its own have: where runs differ in gain, curves
    of the lags over the input would be bought by that."""
    chosen = choose_plant(experiment)
    alike = without_gains(chosen.solved, experiment.logs)
    return choose_plant(replace(experiment, logs=alike)) if alike else chosen


def fit_levels_each(chosen: Chosen, logs: Sequence[RecordedLog]) -> Chosen:
    """A plant whose lags are those of levels with a T_s each, as the clutch's are: runs differ in gain, and what one
    gain for all leaves of that would bend them; with the gain, and on the outputs, of the `logs` as recorded."""
    model, before, x = chosen.solved.setup.model, chosen.solved.fitted, chosen.solved.x.copy()
    recorded = [replace(one.log, output=log.output) for one, log in zip(before.copies, logs, strict=True)]
    own = setup_of(model, recorded, before.idle_free, before.dead_time_s, before.falls_as_left, before.extras)
    solved = replace(chosen.solved, fitted=own)
    u = np.unique(np.concatenate([log.input[log.input > 0] for log in recorded]))
    if model.Ts is not None and len(u) > model.Ts.size:
        each = fit_through(solved, PerLevel(tuple(u.tolist())))
        x[model.Ts.size : own.shared] = each.x[len(u) : each.fitted.shared]
    x = solve_gain(own, x)
    solved = replace(solved, x=x, cost=own.problem().value(x)[0], levels_each=True)
    return replace(chosen, solved=solved, logs=tuple(recorded))


def explains_more(other: Fit, lag: Chosen) -> bool:
    """Whether two lags in series, or what rings, explain steps better than one lag: an overshoot may be of some levels
    alone."""
    part = other.plant_
    if part is None or part.zeta is None or not may_stand(other):
        return False
    return any(row.kind == part.tried[0].kind and (row.score or 1.0) < SURELY_BETTER for row in lag.kinds)


def may_stand(other: Fit) -> bool:
    """Whether a plant of another kind is one that may be taken, whatever it explains."""
    part = other.plant_
    # that a fit without some levels is worse, it shares with the clutch's
    if part is None or not part.another or any(one.code != "hold-out-fails" for one in other.verdict.reasons):
        return False
    if part.plant.kind == "overshoot":  # one that never comes back imitates how the gains of levels scatter
        slowest_s = float(np.max(part.plant.time_constants(np.linspace(*part.plant.u_range, 11))[1]))
        return slowest_s < ENDLESS_RECORDS * max((log.duration_s for log in other.logs), default=np.inf)
    return part.zeta is None or part.zeta > 2 * forms.LEAST_ZETA  # what swings on and on is an output of its own


def takes_its_place(other: Fit, fit: Fit, logs: Sequence[RecordedLog]) -> bool:
    """Whether the plant of another kind explains the steps of a fit so much better, or as well by less; or explains
    them where the fit must not be used."""
    if (part := other.plant_) is None or not may_stand(other):
        return False
    whole, shapes = ([explained_pct(one, logs, own_gains) for one in (other, fit)] for own_gains in (False, True))
    as_well = part.plant.kind == "lag" and whole[0] >= whole[1] - AS_WELL_PCT
    as_well = as_well and 100 - shapes[0] <= (AS_WELL_ALONE if never_slow(fit) else AS_WELL_SHAPED) * (100 - shapes[1])
    swings = part.plant.kind in ("ringing", "series", "overshoot")
    left, of_clutch = subtract_white_noise(((100 - shapes[0]) ** 2, (100 - shapes[1]) ** 2), noise_pct(logs) ** 2)
    far_better = swings and left <= FAR_BETTER**2 * of_clutch
    each = [[explained_pct(one, [log], True) for one in (other, fit)] for log in logs]
    # of a low level noise may hide the shape
    every = all(own >= MUST_EXPLAIN_PCT or 100 - own <= FAR_BETTER * (100 - others) for own, others in each)
    explains = whole[0] >= MUST_EXPLAIN_PCT or every
    return explains and (as_well or far_better or not fit.verdict.of("nonlinear").usable)


def explained_pct(fit: Fit, logs: Sequence[RecordedLog], own_gains: bool) -> float:
    """What the plant of a fit explains of steps from rest, each about its own mean [%]; with `own_gains` of their
    shapes alone."""
    left, total = 0.0, sum(map(squares_about_mean, logs))
    if (part := fit.plant_) is None or not total > 0:
        return 0.0
    for log in logs:
        known = np.isfinite(log.output)
        y, f = log.output[known], from_rest(part.plant, log.time_s[known] + fit.noted_late_s, float(log.input[-1]))
        r = y - f * (best_gain(f, y) if own_gains else 1.0)
        left += log.weight * float(r @ r)
    return 100 * (1 - float(np.sqrt(left / total)))


def noise_pct(logs: Sequence[RecordedLog]) -> float:
    """White noise of steps by the differences of neighbours, as a part of what `explained_pct` is of [%]."""
    noise = sum(log.weight * white_squares(log.output[np.isfinite(log.output)]) for log in logs)
    total = sum(map(squares_about_mean, logs))
    return 100 * float(np.sqrt(noise / total)) if total > 0 else 0.0


def put_in_its_place(other: Fit, fit: Fit, stepset: StepSet) -> Fit:
    """A fit of steps with the plant of another fit of them."""
    part = other.plant_
    assert part is not None
    gone, not_known = ("nonlinear", "friction", "release"), ("linear-parameter-unknown", "linear-may-be-zero")
    kept = [one for one in fit.findings if one.code not in (*OF_SHAPES, *not_known) and one.subject not in gone]
    if part.plant.kind != "overshoot":  # no other has the clutch's slow part
        kept = [one for one in kept if not (one.code == "repeat-is-off" and one.values.get("parameter") == "tau2")]
    if other.uncertainty is not None and other.uncertainty.scatter_from == "engagements":  # single runs tell, too
        kept = [one for one in kept if one.code != "single-runs-few-levels"]
    if part.plant.kind == "ringing":  # its turns are the edges that were seen
        kept = [one for one in kept if not (one.code == "several-edges" and one.values.get("has_input"))]
    told = [one for one in other.findings if one.code in (*OF_PLANT, *not_known)]
    told += merged(
        [msgspec.structs.replace(one, subject="steps") for one in other.findings if one.code == "input-late"]
    )
    if late_s := other.noted_late_s:
        kept = [one for one in kept if not as_late(one, late_s, 1 / (fit.data.sample_rate_hz or np.inf))]
    idle = usual_idle(stepset)  # which the steps were cut from
    named = msgspec.structs.replace(part, input_unit=fit.data.input_unit, output_unit=fit.data.output_unit, idle=idle)
    if (release := release_of(part.plant, cut_behind(stepset, part.dead_time_s))) is not None:
        named = msgspec.structs.replace(named, release=(release.tau1, release.tau2))
    changed: dict[str, Any] = {"nonlinear": other.nonlinear, "linear": other.linear, "release": release}
    changed["friction"] = levels_of_plant(named, fit.data.levels)
    changed["converged"] = other.converged
    if fit.uncertainty is not None and other.uncertainty is not None and other.uncertainty.noise is not None:
        seen, runs = other.uncertainty.noise, median([len(level.runs) for level in stepset.levels])  # of their means
        scatter = seen.scatter if fit.uncertainty.noise is None else fit.uncertainty.noise.scatter
        noise = Noise(runs * seen.sensor_nm2_s, runs * seen.ripple_s, scatter)
        changed["uncertainty"] = msgspec.structs.replace(fit.uncertainty, noise=noise)
    return judged(msgspec.structs.replace(fit, plant_=named, **changed, findings=ranked([*kept, *told])))
