"""Which plant recorded logs have: the clutch's own form, with its dead time and its falls, or another kind of lag."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from eaid.arrays import Array, white_squares
from eaid.errors import DataError, UsageError
from eaid.estimate import forms
from eaid.estimate.recorded_log import RecordedLog, add_rest, shift_input, take_off_creep, take_off_drift
from eaid.findings import Finding, finding
from eaid.levels.creep import SHARE_CHANCE, share_is_told
from eaid.levels.from_steps import ENDLESS_RECORDS
from eaid.plant.drive import delayed
from eaid.plant.dynamics import SHARE
from eaid.plant.forms import Knots, PerLevel, Proportional, Sides
from eaid.recorded.creep import (
    LEAST_GAIN,
    SURE_GAIN,
    find_creeps,
    find_far_creeps,
    find_gain_drift,
    refit_with_creeps,
    sure,
)
from eaid.recorded.curve_intervals import curves
from eaid.recorded.engagements import fit_beside_gains, gains_of_engagements, without_gains
from eaid.recorded.fall_tests import FALL_CHANCE, FALL_NAMES, fit_falls_as_left, fit_with_falls, list_tests, test_falls
from eaid.recorded.from_logs import (
    Setup,
    Solved,
    fit_near,
    fit_setup,
    fit_through,
    idle_found,
    plant_found,
    setup_of,
    start_states,
)
from eaid.recorded.inputs import (
    BEYOND_INPUTS,
    FEW_LEVELS,
    FOLLOWS_SURELY,
    MANY_LEVELS,
    NEXT_TO_REST,
    Excited,
    Experiment,
    follows,
)
from eaid.recorded.kinds import (
    LAG_KINDS,
    PRICE,
    SLOW_PART,
    LagKind,
    Search,
    Tried,
    integrates,
    noise_saves,
    refit_on_all,
    score_kinds,
    try_every_kind,
)
from eaid.recorded.late import (
    BETWEEN_ROWS,
    LEAST_CHANGES,
    LOWER,
    ON_TIME,
    Delay,
    common_delay,
    cost_with_moved_inputs,
    delays,
    fit_behind_dead_time,
    follows_output,
)
from eaid.recorded.left_over import drift_findings
from eaid.recorded.log_intervals import spread
from eaid.results.recorded import FallTest, KindTried

BEYOND_REACHED = 3.0  # Times the output that was reached, beyond which no T_s is believed
OPEN_TS = 0.2  # Relative half-width beyond which T_s is open
LITTLE_BY_KIND_PCT = 15.0  # Of a log that a kind has to explain
LEFT_BY_KIND = 0.04  # Part of the squares about the mean that a kind may leave that takes the place of such a clutch
AS_WELL = 4.0  # Squares over those of a clutch whose T_s is open, up to which another kind is taken in its place
AS_MUCH = 2.0  # Unknowns' worth of noise by which the clutch's form may leave more than the same with another C
MOSTLY = 0.9  # Part of the squares left that is white noise, from which on it is taken off them
LOOPS_BETTER = 0.7  # Squares over those of the clutch, up to which another kind is taken of a loop's log
# What the clutch's form, which is the default, has to save of another kind's squares: this part of them, and more than
# noise saves with its further unknowns (χ²) in so many cases
DEFAULT_SAVES, DEFAULT_CHANCE = 0.01, 0.1
# A free C from which one beyond 1 is tried, with which that begins, and how many times slower its slow part is
AT_ONE, OVERSHOOTS, TWICE_SLOWER = 0.999, 1.2, (5.0, 15.0)
SLOW_SHOWN = 100.0  # Times τ1 that a log has to last before it shows a slow part, if there is one
# The same, before one that never comes is doubted; and times τ1 up to which a slow part is the fast one
SLOW_COMES, TWICE = 30.0, 2.0
FAR_LESS = 0.7  # Squares over those of the clutch, up to which an overshoot explains far more: drifts imitate others
DRIFT_ROUNDS = 3  # In which drifts of gains are found
KNOTS, MOST_KNOTS = 9, 17  # Values through which T_s(u) goes where no cubic does …
LEAST_APART_KNOTS = 0.02  # … and by which part of the range two lie apart at least, as the inputs of the logs have them
ALL_INPUTS = 11  # Inputs over which a form is laid out
FARTHEST_PATTERN, NEAREST = 0.3, 0.01  # Steps of a pattern, as parts of a lag and a dead time
WHOLE_ROW = 0.2  # So near to it a dead time takes a whole row back
FEWEST_RESTING = 10  # Rows of rest before a step that tell its idle output
REST_BELIEVED = 4.0  # Squares of a start at rest over those of one with unknown states, up to which it is believed
# Why a log whose output falls where its input rises, or whose output's rate follows its input, is refused
WRONG_SIGN = (
    "its output falls where its input rises, and a controller would be turned round; write the output, or the input, "
    "with the other sign, or say «rest» where the input rests at its highest"
)
INTEGRATES_INPUT = (
    "its output integrates its input (its rate follows the input, and no lag within the log brings it to rest), as a "
    "position follows a motor's voltage; fit the output's rate, or close a loop and fit that"
)


@dataclass(frozen=True, eq=False)
class Chosen:
    """The plant of logs, and how it was come to."""

    solved: Solved
    logs: tuple[RecordedLog, ...]  # With what is known of where they begin, and inputs where they acted
    falls: tuple[FallTest, ...]
    kinds: tuple[KindTried, ...]
    findings: list[Finding]
    late: tuple[Delay, ...]  # By which the input of each log was noted late
    clutch: Solved | None = None  # The clutch's form, its falls as its rises
    searched: "Searched | None" = None  # Where other kinds were tried, all of them

    @property
    def tried(self) -> list[Solved]:
        """The fit, and that of the clutch's form where it is another."""
        return [one for one in (self.solved, self.clutch) if one is not None]

    @property
    def of_clutch(self) -> bool:
        """Whether it is the clutch's own form."""
        return self.searched is None or self.kinds[0].kind == "clutch"

    def of_kind(self, kind: str) -> "Chosen":
        """The best plant of a kind instead; itself where none was tried."""
        return self if self.searched is None else choose_kind(self.searched, kind)

    @property
    def fell(self) -> tuple[str, ...]:
        """What falls have that differs from rises, as extras of the fit."""
        differ = {one.name for one in self.falls if one.fitted and (one.chance or 0.0) < FALL_CHANCE}
        return tuple(name for name, (first, *_) in FALL_NAMES.items() if first in differ)


@dataclass(frozen=True, eq=False)
class Searched:
    """Every kind that was tried of logs, the one that evidence chooses first."""

    experiment: Experiment
    late: tuple[Delay, ...]
    search: Search  # The logs with their inputs where they acted
    rows: tuple[Tried, ...]
    clutch: Chosen | None = None


def choose_plant(experiment: Experiment) -> Chosen:
    """The plant of the logs, without a creep of their outputs where they show one; loops and steps are not asked. A
    slow part that comes nowhere within them is a creep's beside one lag, where that explains the logs as well."""
    chosen, logs = _choose_plant(experiment), experiment.logs
    steps = len(logs) > 1 and any(log.of_one_level for log in logs)  # whose slow part is a drift, too
    if steps or not experiment.falls or input_answers_output(chosen.solved, chosen.logs):
        return chosen
    behind = _choose_behind_creep(experiment, chosen)
    if chosen.searched is None or not never_comes(behind.solved, experiment.inputs):
        return behind
    lag = next((one.kind.name for one in chosen.searched.rows if one.kind.law == "lag"), "")
    try:
        other = _choose_behind_creep(experiment, replace(choose_kind(chosen.searched, lag), clutch=None))
    except DataError:  # what one lag alone makes of the logs is no reason to refuse them
        return behind
    as_well = other.solved.cost <= AS_WELL * behind.solved.cost
    return other if as_well and not never_comes(other.solved, experiment.inputs) else behind


def never_comes(solved: Solved, inputs: Excited) -> bool:
    """Whether the slow part of two lags in parallel comes within the logs at less than half of the inputs, though they
    are long beside its fast one; of another kind than the clutch's form whether it outlasts them nearly."""
    p, u, longest_s = plant_found(solved), inputs.shown, solved.fitted.longest_s
    tau1, tau2 = p.time_constants(u)
    if p.kind != "parallel" or longest_s < SLOW_COMES * float(np.max(tau1)):
        return False
    most_s = longest_s * (1.0 if solved.fitted.model.kind == "parallel" else SLOW_PART)
    return bool(2 * np.count_nonzero((tau2 < most_s) & (tau2 > TWICE * tau1)) < len(u))


def _choose_behind_creep(experiment: Experiment, chosen: Chosen) -> Chosen:
    """The plant of the logs without a creep, a drift of their gains, or gains of engagements beside one that was
    chosen."""
    logs = experiment.logs
    gains = find_gain_drift(chosen.tried)
    creeps = np.zeros(0) if chosen.clutch is None else find_far_creeps(chosen.clutch, chosen.logs, gains)
    if gains is not None and not creeps.any():
        return _choose_behind_drift(experiment, gains, chosen)
    creeps = creeps if creeps.any() else find_creeps(chosen.tried, chosen.logs)
    if not creeps.any():
        return _choose_beside_gains(experiment, chosen)
    plain = [take_off_creep(log, one) for log, one in zip(logs, creeps, strict=True)]
    again = _choose_plant(replace(experiment, logs=plain))
    solved, without = refit_with_creeps(again.solved, again.logs)
    better = solved.cost < chosen.solved.cost - noise_saves(solved, 2 * len(logs))
    if better and sure(solved, without):
        return replace(again, solved=solved, logs=without)
    return _choose_beside_gains(experiment, chosen)


def _choose_behind_drift(experiment: Experiment, gains: Array, chosen: Chosen) -> Chosen:
    """The plant of logs whose gains grow by such parts, as those amid them make it, which is told."""
    again, total = chosen, gains
    for _ in range(DRIFT_ROUNDS):
        plain = [take_off_drift(log, part, idle_found(again.solved, k) + (log.baseline or 0.0))
                 for k, (log, part) in enumerate(zip(experiment.logs, total.tolist(), strict=True))]  # fmt: skip
        again = _choose_plant(replace(experiment, logs=plain))
        more = find_gain_drift(again.tried, SURE_GAIN)
        if more is None:
            break
        total = total + more
    rows = zip(experiment.logs, (100 * total).tolist(), strict=True)
    told = [finding("gain-drifts", log.name, pct=pct) for log, pct in rows if abs(pct) > 100 * LEAST_GAIN]
    return replace(again, findings=[*again.findings, *told])


def _choose_beside_gains(experiment: Experiment, chosen: Chosen) -> Chosen:
    """The plant of logs whose engagements have gains of their own: chosen and fitted without these, as their squares
    hide how the plant goes."""
    alike = without_gains(chosen.tried[-1], experiment.logs)
    if not alike:
        return chosen
    try:
        again = _choose_plant(replace(experiment, logs=alike))
    except DataError:  # what a log without its gains shows is no reason to refuse it
        return chosen
    recorded = [replace(log, output=one.output) for log, one in zip(again.logs, experiment.logs, strict=True)]
    return replace(again, solved=fit_beside_gains(again.solved, recorded), logs=tuple(recorded), clutch=None)


def _choose_plant(experiment: Experiment) -> Chosen:
    """The clutch's own form behind its dead time, with what falls have of their own; another kind where that explains
    as much with less, or more."""
    logs, options = experiment.logs, experiment.options
    clutch = None if experiment.signed else _fit_clutch_in_time(experiment)
    inside, asked = np.abs(np.concatenate([log.input[log.input != 0] for log in logs])), options.duty
    near = BEYOND_INPUTS * float(inside.max())
    beyond = asked is not None and not inside.min() - near <= asked[0] < asked[1] <= inside.max() + near
    # another kind says nothing of inputs never seen
    alone = options.share == SHARE and not beyond
    # where no input ever changes, gain and idle output cannot be told apart
    still = all(np.ptp(log.input) == 0 and not log.starts_idle for log in logs)
    if clutch is not None and (still or not alone or options.through):
        return clutch
    # gains of these kinds extrapolate nothing: they hold for all that the logs hold, or their own play would be cut off
    rivals = [] if clutch is None else [Tried(LagKind("clutch", "parallel"), clutch.solved)]
    if clutch is not None and (over := fit_overshoot(clutch.solved)) is not None:
        rivals.append(Tried(LagKind("zero", "pair", zero=True), over))
    if clutch is not None and (fast := drop_slow_part(clutch)) is not None:
        rivals.append(Tried(LagKind("lag", "lag", late=fast.dead_time_s > 0), fast, fast_alone=True))
    late = (ON_TIME,) * len(logs) if clutch is None else clutch.late
    searched = _try_kinds_behind(experiment, late, rivals)
    if clutch is not None:
        searched = replace(searched, clutch=clutch)
        ended = refit_with_own_falls(searched, clutch) if experiment.falls else searched.rows
        rows = rank_beside_clutch(replace(searched, rows=tuple(ended)))
        if rows[0] is not ended[0]:  # the others stand as they were looked at
            rows[0] = refit_on_all(searched.search, rows[0], last=True)
        searched = replace(searched, rows=tuple(rows))
    return choose_kind(searched)


def choose_kind(searched: Searched, wanted: str = "") -> Chosen:
    """The plant of the kind that evidence chooses, or of the best row of the one that is `wanted`."""
    rows, logs, clutch, inputs = list(searched.rows), searched.search.logs, searched.clutch, searched.experiment.inputs
    if all(follows(log) > FOLLOWS_SURELY for log in logs):  # of one tone, a long dead time makes a gain below 0
        rows = [one for one in rows if not falls_with_input(one, inputs)] or rows
    if wanted:
        rows = sorted(rows, key=lambda one: one.kind.name != wanted)
    if rows[0] is not searched.rows[0]:
        rows[0] = refit_on_all(searched.search, rows[0], last=True)
    best, total, of_loops = rows[0], sum(map(squares_about_mean, logs)), searched.experiment.of_loops
    explains = best.cost <= (1 - LITTLE_BY_KIND_PCT / 100) ** 2 * total  # noise alone wanders, too
    if explains and not of_loops and integrates(searched.search, best):
        raise DataError(*(f"{log.source or log.name}: {INTEGRATES_INPUT}" for log in logs))
    spread_of_all = squares_about_mean(*logs)  # as every other fit counts
    kinds = tuple(kind_row(one, spread_of_all, best.score) for one in rows)
    signed = searched.search.signed
    if (
        falls_with_input(best, inputs)
        and not (signed or of_loops)
        and (kinds[0].fit_pct or 0.0) > LITTLE_BY_KIND_PCT
        and not drift_findings(best.solved, logs)
    ):
        raise DataError(*(f"{log.source or log.name}: {WRONG_SIGN}" for log in logs))
    if clutch is not None and best.kind.name == "clutch":
        return replace(clutch, kinds=kinds, searched=searched)
    best = separate_lags(best)
    of_lags = searched.experiment.falls and explains and not (signed or input_answers_output(best.solved, logs))
    of_falls, found = tuple[FallTest, ...](), tuple[Finding, ...]()
    if of_lags and (pair := refit_as_two_lags(best.solved)) is not None:
        solved, of_falls, found = test_falls(pair, inputs, free=True)
        if solved is not pair:  # the kind that is taken, with its falls
            best = replace(best, solved=solved)
    kinds = (kind_row(best, spread_of_all, best.score), *kinds[1:])
    told = _kind_findings(best, kinds, logs)
    told += [more for one, log in zip(searched.late, logs, strict=True) for more in one.told(log)]
    of_clutch = None if clutch is None else clutch.clutch
    logs = logs if clutch is None or (best.kind in LAG_KINDS and not best.fast_alone) else clutch.logs
    return Chosen(best.solved, tuple(logs), of_falls, kinds, [*told, *found], searched.late, of_clutch, searched)


def falls_with_input(one: Tried, inputs: Excited) -> bool:
    """Whether the output of a kind falls wherever its input rises."""
    return bool((plant_found(one.solved).curve(inputs.shown) < 0).all())


def rank_beside_clutch(searched: Searched) -> list[Tried]:
    """The kinds, the one to be taken first: the clutch's form stands where it explains as much, and gives way where the
    logs leave its T_s open, or far beyond what they have reached."""
    rows, inputs = searched.rows, searched.experiment.inputs
    own = next(one for one in rows if one.kind.name == "clutch")
    first, comes = rows[0], not never_comes(own.solved, inputs)
    if own is first and searched.experiment.options.duty is None:
        simple = next(one for one in rows if one is not own)
        explains = simple.cost <= LEFT_BY_KIND * sum(map(squares_about_mean, searched.search.logs))
        well = simple.cost <= AS_WELL * own.cost
        if (explains and lies_beyond_outputs(own.solved, inputs)) or (
            well and not (comes and tells_curves(own.solved, inputs, False))
        ):
            first = simple
    if own is not first:
        noise = first.cost / first.solved.independent
        more = own.solved.setup.size - first.solved.setup.size
        parallel = plant_found(first.solved).kind == "parallel"
        same_form = parallel and own.cost <= first.cost + AS_MUCH * PRICE * noise  # with another C
        by_noise = noise_saves(first.solved, more, DEFAULT_CHANCE) if more > 0 else 0.0
        better = own.cost < first.cost - max(DEFAULT_SAVES * first.cost, by_noise)
        told = comes and own.solved.solver.converged
        if (same_form or better) and told and tells_curves(own.solved, inputs, not better):
            first = own
    # noise that goes round a loop bends what has no instruments
    if searched.experiment.of_loops:
        white = sum(map(white_squares, first.solved.missed))
        left, of_clutch = subtract_white_noise((first.cost, own.cost), white)
        first = first if left <= LOOPS_BETTER * of_clutch else own
    fast = next((one for one in rows if one.fast_alone), None)
    if first is own and fast is not None and explains_as_much(fast.solved, own.solved):
        first = fast
    return [first, *(one for one in rows if one is not first)]


def lay_over_all(clutch: Solved, inputs: Excited) -> Solved:
    """The clutch's form with its curves over all inputs that moved, where the logs ask for them beyond those that they
    tell well: a further unknown each of T_s, τ1, τ2 would save less of nothing but noise."""
    model, (least, most) = clutch.setup.model, inputs.ends
    least = max(least, NEXT_TO_REST * most)
    if inputs.stepwise or (model.low, model.high) == (least, most):
        return clutch
    wide = forms.nonlinear(np.linspace(least, most, ALL_INPUTS), model.share)
    start = np.append(wide.unknowns(plant_found(clutch)), clutch.x[model.size :])
    found = fit_near(replace(clutch.fitted, model=wide), start)
    by_noise = noise_saves(found, len(forms.PAPER_DEGREES))
    return found if found.cost < clutch.cost - by_noise else clutch


def _kind_findings(best: Tried, kinds: Sequence[KindTried], logs: Sequence[RecordedLog]) -> list[Finding]:
    """What is said of a kind that takes the clutch's place."""
    theta_s = best.solved.fitted.dead_time_of_plant(best.solved.x)
    own = next((one for one in kinds if one.kind == "clutch"), None)
    told = [
        finding(
            "kind-by-evidence", "plant", kind=best.name, fit_pct=kinds[0].fit_pct, unknowns=kinds[0].unknowns,
            clutch_pct=None if own is None else own.fit_pct, clutch_unknowns=None if own is None else own.unknowns,
        )
    ]  # fmt: skip
    if (kinds[0].fit_pct or 0.0) < LITTLE_BY_KIND_PCT:
        told.append(finding("no-kind-explains", "nonlinear", fit_pct=kinds[0].fit_pct))
    return [*told, *(finding("dead-time", log.name, dead_time_s=theta_s) for log in logs if theta_s > 0)]


def separate_lags(best: Tried) -> Tried:
    """Two lags with a zero whose time constants go with the input, each by a curve of its own where that explains more
    than noise does."""
    if not (best.kind.zero and best.paced) or (pair := refit_as_two_lags(best.solved)) is None:
        return best
    by_noise = noise_saves(pair, pair.fitted.size - best.solved.fitted.size)
    apart = pair.cost < best.cost - max(DEFAULT_SAVES * best.cost, by_noise)
    return replace(best, solved=pair, within=0.0) if apart else best


def refit_as_two_lags(solved: Solved) -> Solved | None:
    """A fit of one lag, or of two real ones with a zero as two in parallel; None of what has no lags apart."""
    setup, x, model = solved.fitted, solved.x, solved.setup.model
    p = model.parameters(solved.coefficients)
    if model.kind == "lag" or p.zeta is not None:
        return solved if model.kind == "lag" else None
    lags = setup.model.tau1
    pair = replace(setup, model=replace(model, tau2=lags, share=None, kind="pair"))
    rows = np.linalg.inv(lags.rows(lags.inputs))
    coefficients = np.r_[x[model.slices[0]], np.ravel([rows @ tau for tau in p.time_constants(lags.inputs)]), p.C]
    begin = [coefficients, x[model.size : setup.shared]]
    for log, place in enumerate(setup.places):
        begin.append(np.r_[x[place.own[0]], start_states(solved, log), x[place.own[3:]]][place.own >= 0])
    return fit_near(pair, np.concatenate(begin))


def refit_with_own_falls(searched: Searched, clutch: Chosen) -> Sequence[Tried]:
    """Kinds with one lag having falls of its own where the clutch has, or leaves its τ2 to them: the best and the
    simplest of it, for curves imitate falls."""
    rows = searched.rows
    names, lags = clutch.fell, [one for one in rows if one.kind.law == "lag"]
    near = rows[0].kind.name == "clutch" and lags[0].cost <= AS_WELL * rows[0].cost
    if not names and near and not input_answers_output(clutch.solved, clutch.logs):
        names = list_tests(clutch.solved.setup, searched.experiment.inputs.stepwise, free=True)
    if not names:
        return rows
    both = list(dict.fromkeys((lags[0], min(lags, key=lambda one: one.solved.setup.size))))
    ended = [refit_on_all(searched.search, one, last=True) for one in both]
    fallen = [replace(one, solved=fit_with_falls(one.solved, names)) for one in ended]
    return score_kinds([*fallen, *(one for one in rows if one not in both)])


def _try_kinds_behind(
    experiment: Experiment, late: tuple[Delay, ...], rivals: Sequence[Tried], passes: int = 4
) -> Searched:
    """Every kind fitted to the logs with their inputs where they acted, the best first; and how late these were noted
    by the best kind, which may move them again."""
    logs, inputs, given_s = experiment.logs, experiment.inputs, experiment.options.held_dead_time_s
    acting = (shift_input(log, one.rows) for log, one in zip(logs, late, strict=True))
    begun = tuple(mark_resting_start(log, inputs) for log in acting)
    as_left = any(one.solved.fitted.falls_as_left for one in rivals)
    search = Search(begun, inputs.low, inputs.high, given_s, as_left)
    rows = try_every_kind(search, len(inputs.levels) if inputs.stepwise else MANY_LEVELS, rivals)
    if passes > 1 and rows[0].kind.zero and rows[0].kind.late:  # what came before a log began makes a zero, too
        shown = [drop_outputs_before(log, rows[0].solved.dead_time_s) for log in logs]
        if any(one is not log for one, log in zip(shown, logs, strict=True)):
            return _try_kinds_behind(replace(experiment, logs=shown), late, rivals, passes - 1)
    found = _find_delays(rows[0].solved, search, late)
    most = rows[0].cost * (1 + PRICE / rows[0].solved.independent)  # that one unknown less leaves by noise
    without_lead = _replace_lead(search, rows, late, most)
    found = without_lead or found
    here = Searched(experiment, late, search, tuple(rows))
    if [one.rows for one in found] == [one.rows for one in late]:
        return replace(here, late=found)
    moved = _try_kinds_behind(experiment, found, rivals, passes - 1) if passes > 1 else here
    return here if without_lead and moved.rows[0].cost > most else moved


def drop_outputs_before(log: RecordedLog, dead_s: float) -> RecordedLog:
    """A log that does not begin at rest, without the outputs at which an input from before it still acts."""
    before = (log.time_s < log.time_s[0] + dead_s) & ~np.isnan(log.output)
    if log.starts_idle or log.reference is not None or not before.any():
        return log
    return replace(log, output=np.where(before, np.nan, log.output))


def _replace_lead(search: Search, rows: Sequence[Tried], late: tuple[Delay, ...], most: float) -> tuple[Delay, ...]:
    """By how much inputs were noted late where the best kind has a zero, as that makes one, and the same lags without
    it leave no more than `most` squares behind their delay; empty where they do not."""
    plain = next((one for one in rows if one.kind.law == "swing" and not (one.kind.zero or one.kind.late)), None)
    if not rows[0].kind.zero or rows[0].kind.late or plain is None:
        return ()
    found = _find_delays(plain.solved, search, late)
    more = [new.rows - old.rows for new, old in zip(found, late, strict=True)]
    return found if any(more) and cost_with_moved_inputs(plain.solved, search.logs, more) <= most else ()


def _find_delays(solved: Solved, search: Search, late: tuple[Delay, ...]) -> tuple[Delay, ...]:
    """By how much inputs were noted late, by a kind fitted with them `late`; what moved them too far is its dead
    time."""
    if search.dead_time_s is not None:
        return late
    # a rival was fitted to the logs before their starts were judged
    fitted = zip(search.logs, solved.fitted.drives, strict=False)
    acting = [replace(log, idle_start=drive.starts_idle) for log, drive in fitted]
    if (theta_s := solved.dead_time_s) > 0:
        back = [int(theta_s / log.usual_s + WHOLE_ROW) for log in acting]
        moved = [one.later(-by) for one, by in zip(late, back, strict=True)]
    else:
        alone = any(len(log.changes) >= LEAST_CHANGES or not log.starts_idle for log in acting)
        more = delays(solved, acting) if alone else [common_delay(solved, acting)] * len(acting)
        moved = [new.later(one.rows) for one, new in zip(late, more, strict=True)]
    return tuple(one if one.rows > 0 else ON_TIME for one in moved)


def subtract_white_noise(squares: tuple[float, float], white: float) -> tuple[float, float]:
    """What two fits leave, without the white noise that hides how they differ where it is most of the first's."""
    noise = white if white >= MOSTLY * squares[0] else 0.0
    return max(squares[0] - noise, 0.0), max(squares[1] - noise, 0.0)


def mark_resting_start(log: RecordedLog, inputs: Excited) -> RecordedLog:
    """A log that begins with some rows at rest known to be at rest where the output does not deny it."""
    if log.idle_start is not None or log.starts_idle or log.input[0] != 0 or not log.input.any():
        return log
    resting = replace(log, idle_start=True)
    return resting if quick_cost(resting, inputs) <= REST_BELIEVED * quick_cost(log, inputs) else log


def count_from_rest(log: RecordedLog) -> RecordedLog:
    """A log of a single step counted from the rest before it: with an idle output of its own, one of several such logs
    would hide how runs scatter."""
    first = int(np.argmax(log.input != 0))
    known = log.baseline is None and log.of_one_level and log.reference is None and first >= FEWEST_RESTING
    return replace(log, baseline=float(np.nanmean(log.output[:first]))) if known else log


def add_rest_before(log: RecordedLog, inputs: Excited) -> RecordedLog:
    """A log that begins with its input on, behind the rest before it where a dead time shows that there was one."""
    if log.idle_start is not None or log.input[0] == 0 or np.ptp(log.input) == 0 or log.reference is not None:
        return log
    resting = add_rest(log)
    return resting if quick_cost(resting, inputs) < (1 - LOWER) * quick_cost(log, inputs) else log


def quick_cost(log: RecordedLog, inputs: Excited) -> float:
    """Squares that the best lag near a few with dead times leaves of a log."""
    search = Search((log,), inputs.low, inputs.high)
    shapes = [(tau, np.inf) for tau in np.geomspace(search.shortest_s, search.longest_s, 12).tolist()]
    rows = list[tuple[float, float, float]]()
    for theta in (0.0, *np.geomspace(0.5 * search.shortest_s, 0.2 * search.longest_s, 8).tolist()):
        costs = search.costs([delayed(drive, theta) for drive in search.drives], shapes)[:, 0].tolist()
        rows += [(cost, tau, theta) for cost, (tau, _) in zip(costs, shapes, strict=True)]
    least, tau, theta = min(rows)
    apart = FARTHEST_PATTERN
    while apart > NEAREST:  # between these, by a pattern that halves
        factor = 1 + apart
        around = ((tau * factor, theta), (tau / factor, theta), (tau, theta * factor), (tau, theta / factor))
        near = min((search.cost(late, lag, np.inf), lag, late) for lag, late in around)
        if near[0] < least:
            least, tau, theta = near
        else:
            apart /= 2
    return least


def lies_beyond_outputs(solved: Solved, inputs: Excited) -> bool:
    """Whether T_s of a fit lies far beyond what the logs have reached."""
    reached = max(float(np.abs(y - idle_found(solved, k)).max(initial=0.0)) for k, y in enumerate(solved.outputs))
    return float(np.abs(solved.curves(inputs.shown).steady).max()) > BEYOND_REACHED * reached


def tells_curves(solved: Solved, inputs: Excited, each: bool) -> bool:
    """Whether the logs tell T_s of a fit at more than half of its inputs, and `each` of its time constants at some."""
    Ts, *taus = curves(solved, spread(solved), inputs.shown).half_width
    return bool(np.mean(Ts > OPEN_TS) < 0.5 and (not each or all(np.isfinite(tau).any() for tau in taus)))


def _fit_clutch_in_time(experiment: Experiment) -> Chosen:
    """The clutch's form; of inputs that were noted late by a part of a row which comes to next to none beside what
    falls have of their own, on time."""
    clutch = _fit_clutch(experiment)
    each = zip(clutch.late, clutch.logs, strict=True)
    off = [abs(one.rows - clutch.solved.dead_time_s / log.usual_s) for one, log in each]
    if not clutch.solved.fitted.between_rows or max(off) >= BETWEEN_ROWS:
        return clutch
    return _fit_clutch(replace(experiment, options=replace(experiment.options, dead_time=0.0)))


def _fit_clutch(experiment: Experiment) -> Chosen:
    """Two lags in parallel over the input, behind the dead time of the logs, with what falls have of their own."""
    logs, inputs, options, falls = experiment.logs, experiment.inputs, experiment.options, experiment.falls
    model = forms.nonlinear(inputs.basis, options.held_share)
    base = fit_setup(setup_of(model, logs, experiment.rests))
    base = fit_falls_as_left(base) if falls else base
    ask_share = options.share == SHARE
    behind, acting, late = fit_behind_dead_time(base, experiment)
    moved = behind.fitted.dead_time_of_plant(behind.x) > 0 or any(one.rows for one in late)
    if ask_share and moved and (free_first := refit_with_share_free(base)) is not None:  # a wrong C moves inputs
        other = fit_behind_dead_time(free_first[0], experiment)
        held = refit_with_share_free(behind) or (behind, 0.0)
        if other[0].cost < held[0].cost:
            behind, acting, late = other
    base, findings = behind, []
    if (theta_s := base.fitted.dead_time_of_plant(base.x)) and falls and not base.fitted.falls_as_left:  # which hid it
        base = fit_falls_as_left(base)
        theta_s = base.fitted.dead_time_of_plant(base.x)
    for log, one in zip(logs, late, strict=True):
        if one.rows > 0:
            findings += one.told(log)
        elif theta_s > 0:
            findings.append(finding("dead-time", log.name, dead_time_s=theta_s))
    free = not input_answers_output(base, acting)
    if free and ask_share and (found := refit_with_share_free(base)) is not None:
        base, ends = found
        low, high = (base.x[base.setup.model.size - 1] + np.array([-ends, ends])).tolist()
        findings.append(finding("share-by-evidence", "nonlinear", held=SHARE, C=(low + high) / 2, low=low, high=high))
    if options.duty is None:
        base = lay_over_all(base, inputs)
    if options.through:
        if not inputs.stepwise or not 1 < len(inputs.levels) <= FEW_LEVELS:
            raise UsageError("«curve» levels: these logs hold no levels, or too many; leave it out")
        base = fit_through(base, PerLevel(tuple(inputs.levels.tolist())))
    if options.curve == "auto":
        base = fit_through_knots(base, inputs)
    plain, of_falls = base, tuple[FallTest, ...]()
    if falls:
        base, of_falls, more = test_falls(plain, inputs, free)
        again = fit_through_knots(base, inputs) if options.curve == "auto" and base is not plain else base
        if again is not base and isinstance(knots := again.setup.model.Ts, Knots):  # which falls had hid
            plain = fit_through(plain, knots)
            base, of_falls, more = test_falls(plain, inputs, free)
        findings += more
    if isinstance(curve := base.setup.model.Ts, Knots):
        findings.append(finding("torque-curve-by-evidence", "nonlinear", values=curve.size))
    return Chosen(base, acting, of_falls, (), findings, late, plain)


def fit_through_knots(base: Solved, inputs: Excited, count: int = KNOTS) -> Solved:
    """A fit with T_s(u) through values at `count` inputs, or more, where logs ask for more than a cubic, be it for
    falls or a hysteresis that they do not have; itself where they do not, or hold few levels, or have such a T_s(u)."""
    model, first = base.setup.model, base.setup.model.slices[0].stop
    few = len(inputs.levels) <= FEW_LEVELS if inputs.stepwise else not model.low < model.high
    if few or not first < count <= MOST_KNOTS:
        return base
    sizes = np.abs(np.concatenate([drive.duty[drive.which] for drive in base.setup.drives]))
    sizes = sizes[(sizes > 0) & (sizes >= model.low) & (sizes <= model.high)]
    if len(sizes) < count:
        return base
    for shown in (sizes, np.unique(sizes)):  # where most of the time goes to few inputs, as these lie
        at = np.array([model.low, *np.quantile(shown, np.linspace(0, 1, count)[1:-1]), model.high])
        if far := bool((np.diff(at) >= LEAST_APART_KNOTS * (model.high - model.low)).all()):
            break
    if not far:
        at = np.linspace(model.low, model.high, count)
    found = fit_through(base, Knots(tuple(at.tolist())))
    chance = SHARE_CHANCE if count == KNOTS else DEFAULT_CHANCE  # once no cubic does, a few more cost little
    better = cost_beside_gains(found) < cost_beside_gains(base) - noise_saves(found, count - first, chance)
    return fit_through_knots(found, inputs, 2 * count - 1) if better else base


def cost_beside_gains(solved: Solved) -> float:
    """What a fit leaves beside gains of their own of the logs that hold one level: how these scatter bends no curve."""
    cost = solved.cost
    for k, (drive, one) in enumerate(zip(solved.setup.drives, solved.setup.copies, strict=True)):
        if one.log.of_one_level:
            _, _, square, gain, _ = gains_of_engagements(solved, k)
            cost -= float(drive.w[drive.w > 0].mean() * (gain**2 @ square))
    return cost


def input_answers_output(solved: Solved, logs: Sequence[RecordedLog]) -> bool:
    """Whether the input of some log answers its output, as a loop's does."""
    return any(log.reference is not None or follows_output(solved, k, log) for k, log in enumerate(logs))


def refit_with_share_free(held: Solved) -> tuple[Solved, float] | None:
    """A fit with C free, be it so already, and its half-width, where logs reject the one that was held and tell
    another."""
    free = held
    if held.fitted.model.share is not None:
        free = free_share(held, held.fitted.model.share)
    at = free.fitted.model.size - 1
    if free is not held and (free.cost > held.cost - noise_saves(held, 1) or not 0 < free.x[at] < 1):
        return None
    half = spread(free).of(np.eye(len(free.x))[at])
    sure = abs(free.x[at] - SHARE) > half and share_is_told(free.x[at] - half, free.x[at] + half)
    return (free, half) if sure else None


def free_share(held: Solved, share: float) -> Solved:
    """The fit with C as an unknown, from where it was held at."""
    model = held.fitted.model
    return fit_near(replace(held.fitted, model=replace(model, share=None)), np.insert(held.x, model.size, share))


def drop_slow_part(clutch: Chosen) -> Solved | None:
    """The clutch's form with its fast lag alone, where that explains as much: a slow part that no log shows hides in a
    T_s which is as much larger, and τ2 runs away. None where the logs are too short to show one."""
    plain = clutch.clutch or clutch.solved
    setup, model, x = plain.fitted, plain.fitted.model, plain.x
    gain, one, _ = model.slices
    slowest_s = float((model.tau1.rows(model.limited) @ x[one]).max())
    if model.kind != "parallel" or model.tau2 is None or setup.longest_s < SLOW_SHOWN * slowest_s:
        return None
    fast = replace(setup, model=replace(model, tau2=None, share=1.0, kind="lag"))
    begin = np.zeros(fast.size)
    begin[gain] = x[gain] * (plain.coefficients[-1] if model.share is None else model.share)
    begin[one] = x[one]
    begin[fast.model.size : fast.shared] = x[model.size : setup.shared]
    for of_fast, own in zip(fast.places, setup.places, strict=True):
        kept = of_fast.own >= 0
        begin[of_fast.own[kept]] = x[own.own[kept]]
    found = fit_near(fast, begin)
    return found if explains_as_much(found, plain) else None


def explains_as_much(fewer: Solved, more: Solved) -> bool:
    """Whether a fit with fewer unknowns leaves no more than another but for what noise saves."""
    unknowns = more.setup.size - fewer.setup.size
    return unknowns > 0 and fewer.cost <= more.cost + noise_saves(more, unknowns)


def fit_overshoot(clutch: Solved) -> Solved | None:
    """The clutch's form with a C beyond 1, where it leads there, or its slow part never comes; None of others."""
    setup, model, (gain, one, two) = clutch.fitted, clutch.fitted.model, clutch.fitted.model.slices
    if model.share is None or model.tau2 is None:
        return None
    free = free_share(clutch, model.share)
    endless = float(clutch.curves(model.limited).tau2.max()) > ENDLESS_RECORDS * setup.longest_s
    if free.x[model.size] < AT_ONE and not endless:
        return None
    pair, ends = replace(setup, model=replace(model, share=None, kind="pair")), []
    tau1 = model.tau1.rows(model.tau2.inputs) @ free.x[one]
    for times in TWICE_SLOWER:
        x = free.x.copy()
        x[gain] *= model.share if endless else 1.0
        x[two] = np.linalg.solve(model.tau2.rows(model.tau2.inputs), times * tau1)
        x[model.size] = OVERSHOOTS
        ends.append(fit_near(pair, x))
    best = min(ends, key=lambda end: end.cost)
    return best if best.x[model.size] > 1 and best.cost < FAR_LESS * clutch.cost else None


def squares_about_mean(*logs: RecordedLog) -> float:
    """Weighted squares of outputs about the mean of all."""
    mean = np.nanmean(np.concatenate([log.output for log in logs]))
    return sum(log.weight * float(np.nansum((log.output - mean) ** 2)) for log in logs)


def kind_row(one: Tried, total: float, least: float) -> KindTried:
    """A kind as the result tells it."""
    form = one.solved.setup.model.Ts
    gain = (
        "one" if isinstance(form, Proportional) and form.size == 1 else "sides" if isinstance(form, Sides) else "curve"
    )
    fit_pct = 100 * (1 - float(np.sqrt(max(one.cost, 0.0) / total))) if total > 0 else None
    score = one.score / least if least > 0 else None
    lags: Literal["constant", "curve"] = "curve" if one.paced or one.kind.name == "clutch" else "constant"
    return KindTried(one.name, gain, lags, one.solved.setup.size, fit_pct, score)


def set_up_above_idle(base: Solved, logs: Sequence[RecordedLog]) -> Setup:
    """The logs with the idle output that the plant has, for the linear model: it begins where the plant does."""
    known = [replace(log, baseline=idle_found(base, k) + (log.baseline or 0.0)) for k, log in enumerate(logs)]
    return setup_of(base.fitted.model, known, True, base.dead_time_s)
