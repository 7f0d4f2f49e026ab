"""The clutch's own form over recorded logs: two lags in parallel behind a dead time, with falls of their own.

C is held at 0.85 until logs reject it and tell another; T_s(u) goes through values where no cubic does; the slow part
is dropped where the logs are long enough to show one and do not; and a C beyond 1 is tried where the fit leads there.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eaid.arrays import Array
from eaid.estimate import forms
from eaid.estimate.recorded_log import RecordedLog
from eaid.findings import Finding, finding
from eaid.levels.creep import SHARE_CHANCE, share_is_told
from eaid.levels.from_steps import ENDLESS_RECORDS
from eaid.plant.dynamics import SHARE
from eaid.plant.forms import Knots, PerLevel, knots_at, torque_form
from eaid.recorded.engagements import gains_of_engagements
from eaid.recorded.fall_tests import FALL_CHANCE, FALL_NAMES, add_falls, fit_falls_as_left, list_tests, test_falls
from eaid.recorded.from_logs import Solved, come_near, fit_near, fit_setup, fit_through, plant_found, setup_of
from eaid.recorded.inputs import FEW_LEVELS, NEXT_TO_REST, Excited, Experiment
from eaid.recorded.kinds import SLOW_PART, Search, Tried, noise_saves
from eaid.recorded.late import Delay, fit_behind_dead_time, follows_output
from eaid.recorded.log_intervals import spread
from eaid.results.recorded import FallTest, KindTried

# A free C from which one beyond 1 is tried, with which that begins, and how many times slower its slow part is
AT_ONE, OVERSHOOTS, TWICE_SLOWER = 0.999, 1.2, (5.0, 15.0)
SLOW_SHOWN = 100.0  # Times τ1 that a log has to last before it shows a slow part, if there is one
# The same, before one that never comes is doubted; and times τ1 up to which a slow part is the fast one
SLOW_COMES, TWICE = 30.0, 2.0
FAR_LESS = 0.7  # Squares over those of the clutch, up to which an overshoot explains far more: drifts imitate others
KNOTS, MOST_KNOTS = 9, 17  # Values through which T_s(u) goes where no cubic does
ALL_INPUTS = 11  # Inputs over which a form is laid out
DEFAULT_CHANCE = 0.1  # That noise alone saves as much as a further curve or kind does


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


def fit_clutch_form(experiment: Experiment) -> Chosen:
    """Two lags in parallel over the input, behind the dead time of the logs, with what falls have of their own."""
    logs, inputs, options, falls = experiment.logs, experiment.inputs, experiment.options, experiment.falls
    model = forms.nonlinear(inputs.basis, options.held_share)
    base = fit_setup(setup_of(model, logs, experiment.rests))
    base = fit_falls_as_left(base) if falls else base
    ask_share = options.share == SHARE
    behind, acting, late = fit_behind_dead_time(base, experiment, with_own_falls)
    moved = behind.fitted.dead_time_of_plant(behind.x) > 0 or any(one.rows for one in late)
    if ask_share and moved and (free_first := refit_with_share_free(base)) is not None:  # a wrong C moves inputs
        other = fit_behind_dead_time(free_first[0], experiment, with_own_falls)
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
    base = fit_curve(base, inputs, options.curve)
    plain, of_falls = base, tuple[FallTest, ...]()
    if falls:
        base, of_falls, more = test_falls(plain, inputs, free)
        again = fit_through_knots(base, inputs) if options.curve == "auto" and base is not plain else base
        if again is not base and isinstance(knots := again.setup.model.Ts, Knots):  # which falls had hid
            plain = fit_through(plain, knots)
            base, of_falls, more = test_falls(plain, inputs, free)
        findings += more
    if options.curve == "auto" and isinstance(curve := base.setup.model.Ts, Knots):
        findings.append(finding("torque-curve-by-evidence", "nonlinear", values=curve.size))
    return Chosen(base, acting, of_falls, (), findings, late, plain)


def with_own_falls(base: Solved, experiment: Experiment) -> Solved:
    """The fit with numbers of their own of all falls that held inputs tell; itself where they tell none."""
    names = list_tests(base.setup, True, free=True) if experiment.falls and experiment.inputs.stepwise else ()
    return come_near(*add_falls(base, names)) if names else base


def refit_with_share_free(held: Solved) -> tuple[Solved, float] | None:
    """A fit with C free, be it so already, and its half-width, where logs reject the one that was held and tell
    another."""
    free, model = held, held.fitted.model
    at = model.size - model.free_share
    if model.share is not None:
        near = free_share(held, model.share)
        if near.cost > held.cost - noise_saves(held, 1) or not 0 < near.x[at] < 1:
            return None
        free = fit_near(near.fitted, near.x)
    half = spread(free).of(np.eye(len(free.x))[at])
    sure = abs(free.x[at] - SHARE) > half and share_is_told(free.x[at] - half, free.x[at] + half)
    return (free, half) if sure else None


def free_share(held: Solved, share: float) -> Solved:
    """The fit with C as an unknown, next to its end, from where it was held at."""
    model = held.fitted.model
    return come_near(replace(held.fitted, model=replace(model, share=None)), np.insert(held.x, model.size, share))


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


def fit_curve(base: Solved, inputs: Excited, curve: str) -> Solved:
    """A fit with T_s(u) as the option «curve» has it."""
    if curve == "levels":
        return fit_through(base, PerLevel(tuple(inputs.levels.tolist())))
    ends = base.setup.model.low, base.setup.model.high
    if (form := torque_form(curve, np.append(inputs_within(base), ends))) is not None:
        return fit_through(base, form)
    return fit_through_knots(base, inputs) if curve == "auto" else base


def inputs_within(base: Solved) -> Array:
    """Inputs of the logs, by size, over which the curves of a fit are laid out."""
    sizes, model = np.abs(np.concatenate([drive.duty[drive.which] for drive in base.setup.drives])), base.setup.model
    return np.asarray(sizes[(sizes > 0) & (sizes >= model.low) & (sizes <= model.high)])


def fit_through_knots(base: Solved, inputs: Excited, count: int = KNOTS) -> Solved:
    """A fit with T_s(u) through values at `count` inputs, or more, where logs ask for more than a cubic, be it for
    falls or a hysteresis that they do not have; itself where they do not, or hold few levels, or have such a T_s(u)."""
    model, first = base.setup.model, base.setup.model.slices[0].stop
    few = len(inputs.levels) <= FEW_LEVELS if inputs.stepwise else not model.low < model.high
    if few or not first < count <= MOST_KNOTS:
        return base
    sizes = inputs_within(base)
    if len(sizes) < count:
        return base
    found = fit_through(base, Knots(knots_at(sizes, model.low, model.high, count)))
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


def never_comes(solved: Solved, inputs: Excited) -> bool:
    """Whether the slow part of two lags in parallel comes within the logs at less than half of the inputs, though they
    are long beside its fast one; of another kind than the clutch's form whether it outlasts them nearly."""
    p, u, longest_s = plant_found(solved), inputs.shown, solved.fitted.longest_s
    tau1, tau2 = p.time_constants(u)
    if p.kind != "parallel" or longest_s < SLOW_COMES * float(np.max(tau1)):
        return False
    most_s = longest_s * (1.0 if solved.fitted.model.kind == "parallel" else SLOW_PART)
    return bool(2 * np.count_nonzero((tau2 < most_s) & (tau2 > TWICE * tau1)) < len(u))


def input_answers_output(solved: Solved, logs: Sequence[RecordedLog]) -> bool:
    """Whether the input of some log answers its output, as a loop's does."""
    return any(log.reference is not None or follows_output(solved, k, log) for k, log in enumerate(logs))
