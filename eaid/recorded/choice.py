"""Which kind of plant recorded logs have: the clutch's own form, or another kind of lag where evidence asks for it."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from eaid.arrays import white_squares
from eaid.errors import DataError
from eaid.estimate.recorded_log import RecordedLog, shift_input
from eaid.findings import Finding, finding
from eaid.plant.dynamics import SHARE
from eaid.plant.forms import Proportional, Sides
from eaid.recorded.begins import mark_resting_start
from eaid.recorded.clutch_form import (
    DEFAULT_CHANCE,
    Chosen,
    Searched,
    drop_slow_part,
    explains_as_much,
    fit_clutch_form,
    fit_overshoot,
    input_answers_output,
    never_comes,
)
from eaid.recorded.curve_intervals import curves
from eaid.recorded.fall_tests import fit_with_falls, list_tests, test_falls
from eaid.recorded.from_logs import Solved, fit_near, idle_found, plant_found, start_states
from eaid.recorded.inputs import BEYOND_INPUTS, FOLLOWS_SURELY, MANY_LEVELS, Excited, Experiment, follows
from eaid.recorded.kinds import (
    LAG_KINDS,
    PRICE,
    LagKind,
    Search,
    Tried,
    integrates,
    noise_saves,
    refit_on_all,
    score_kinds,
    try_every_kind,
)
from eaid.recorded.late import LEAST_CHANGES, ON_TIME, Delay, common_delay, cost_with_moved_inputs, delays
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
# noise saves with its further unknowns (χ²) in `DEFAULT_CHANCE` of cases
DEFAULT_SAVES = 0.01
WHOLE_ROW = 0.2  # So near to it a dead time takes a whole row back
# Why a log whose output falls where its input rises, or whose output's rate follows its input, is refused
WRONG_SIGN = (
    "its output falls where its input rises, and a controller would be turned round; write the output, or the input, "
    "with the other sign, or say «rest» where the input rests at its highest"
)
INTEGRATES_INPUT = (
    "its output integrates its input (its rate follows the input, and no lag within the log brings it to rest), as a "
    "position follows a motor's voltage; fit the output's rate, or close a loop and fit that"
)


def choose_among_kinds(experiment: Experiment) -> Chosen:
    """The clutch's own form behind its dead time, with what falls have of their own; another kind where that explains
    as much with less, or more."""
    logs, options = experiment.logs, experiment.options
    one_sided, several = not experiment.signed, len(experiment.inputs.levels) > 1
    # falls alone tell no lags of the inputs that they come from
    clutch = fit_clutch_form(experiment) if one_sided and not (several and experiment.falls_alone) else None
    inside, asked = np.abs(np.concatenate([log.input[log.input != 0] for log in logs])), options.duty
    near = BEYOND_INPUTS * float(inside.max())
    beyond = asked is not None and not inside.min() - near <= asked[0] < asked[1] <= inside.max() + near
    # another kind says nothing of inputs never seen
    alone = options.share == SHARE and not beyond
    # where no input ever changes, gain and idle output cannot be told apart
    still = all(np.ptp(log.input) == 0 and not log.starts_idle for log in logs)
    if clutch is not None and (still or not alone or options.holds_curve):
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
        if rows[0] is not ended[0] or not rows[0].solved.fitted.copies:  # the others stand as they were looked at
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


def _try_kinds_behind(
    experiment: Experiment, late: tuple[Delay, ...], rivals: Sequence[Tried], passes: int = 4
) -> Searched:
    """Every kind fitted to the logs with their inputs where they acted, the best first; and how late these were noted
    by the best kind, which may move them again."""
    logs, inputs, given_s = experiment.logs, experiment.inputs, experiment.options.held_dead_time_s
    acting = (shift_input(log, one.rows) for log, one in zip(logs, late, strict=True))
    begun = tuple(mark_resting_start(log, inputs) for log in acting)
    as_left = any(one.solved.fitted.falls_as_left for one in rivals)
    search = Search(begun, inputs.low, inputs.high, given_s, as_left, experiment.options.curve == "auto")
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


def falls_with_input(one: Tried, inputs: Excited) -> bool:
    """Whether the output of a kind falls wherever its input rises."""
    return bool((plant_found(one.solved).curve(inputs.shown) < 0).all())


def lies_beyond_outputs(solved: Solved, inputs: Excited) -> bool:
    """Whether T_s of a fit lies far beyond what the logs have reached."""
    reached = max(float(np.abs(y - idle_found(solved, k)).max(initial=0.0)) for k, y in enumerate(solved.outputs))
    return float(np.abs(solved.curves(inputs.shown).steady).max()) > BEYOND_REACHED * reached


def tells_curves(solved: Solved, inputs: Excited, each: bool) -> bool:
    """Whether the logs tell T_s of a fit at more than half of its inputs, and `each` of its time constants at some."""
    Ts, *taus = curves(solved, spread(solved), inputs.shown).half_width
    return bool(np.mean(Ts > OPEN_TS) < 0.5 and (not each or all(np.isfinite(tau).any() for tau in taus)))


def squares_about_mean(*logs: RecordedLog) -> float:
    """Weighted squares of outputs about the mean of all."""
    mean = np.nanmean(np.concatenate([log.output for log in logs]))
    return sum(log.weight * float(np.nansum((log.output - mean) ** 2)) for log in logs)


def subtract_white_noise(squares: tuple[float, float], white: float) -> tuple[float, float]:
    """What two fits leave, without the white noise that hides how they differ where it is most of the first's."""
    noise = white if white >= MOSTLY * squares[0] else 0.0
    return max(squares[0] - noise, 0.0), max(squares[1] - noise, 0.0)
