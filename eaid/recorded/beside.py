"""The plant of recorded logs beside what is none of it: jumps and creeps of outputs, drifts and scatter of gains.

Each of these imitates a slow part, falls that differ or a hysteresis. The plant is chosen first; where logs show one of
them beside it, it is chosen anew without.
"""

from dataclasses import replace

import numpy as np

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.estimate.recorded_log import take_off_creep, take_off_drift, take_off_jump
from eaid.findings import finding
from eaid.recorded.choice import AS_WELL, choose_among_kinds, choose_kind
from eaid.recorded.clutch_form import Chosen, input_answers_output, never_comes
from eaid.recorded.creep import (
    LEAST_GAIN,
    SURE_GAIN,
    find_creeps,
    find_far_creeps,
    find_gain_drift,
    refit_with_creeps,
    sure,
)
from eaid.recorded.engagements import FEWEST_ENGAGEMENTS, fit_beside_gains, without_gains
from eaid.recorded.from_logs import idle_found
from eaid.recorded.inputs import Experiment
from eaid.recorded.jump import find_jump, jump_size
from eaid.recorded.kinds import noise_saves
from eaid.recorded.left_over import MUCH

DRIFT_ROUNDS = 3  # In which drifts of gains are found
JUMP_ROUNDS, JUMP_SETTLED = 4, 0.01  # The same of jumps, and the part of one that ends them


def choose_plant(experiment: Experiment) -> Chosen:
    """The plant of the logs, without a jump or a creep of their outputs where they show one; loops and steps are not
    asked. A slow part that comes nowhere within them is a creep's beside one lag, where that explains the logs as well.
    """
    chosen, logs = choose_among_kinds(experiment), experiment.logs
    steps = len(logs) > 1 and any(log.of_one_level for log in logs)  # whose slow part is a drift, too
    if steps or not experiment.falls or input_answers_output(chosen.solved, chosen.logs):
        return chosen
    behind = _choose_behind_creep(experiment, chosen)
    if len(logs) >= FEWEST_ENGAGEMENTS and behind.solved.beside is None:  # gains of each log bend it as a creep does
        beside = _choose_beside_gains(experiment, chosen)
        left = beside.solved.beside
        behind = beside if left is not None and left.cost <= behind.solved.cost else behind
    without, again = _choose_behind_jumps(experiment, chosen)
    if without is not experiment:  # a jump explains a part of a creep or a drift, too
        other = _choose_behind_creep(without, again)
        if other.solved.cost < (1 - MUCH) * behind.solved.cost:
            experiment, chosen, behind = without, again, other
    if chosen.searched is None or not never_comes(behind.solved, experiment.inputs):
        return behind
    lag = next((one.kind.name for one in chosen.searched.rows if one.kind.law == "lag"), "")
    try:
        other = _choose_behind_creep(experiment, replace(choose_kind(chosen.searched, lag), clutch=None))
    except DataError:  # what one lag alone makes of the logs is no reason to refuse them
        return behind
    as_well = other.solved.cost <= AS_WELL * behind.solved.cost
    return other if as_well and not never_comes(other.solved, experiment.inputs) else behind


def _choose_behind_jumps(experiment: Experiment, chosen: Chosen) -> tuple[Experiment, Chosen]:
    """Logs without the jumps of their sensors' zeros, and the plant of these."""
    logs, again = experiment.logs, chosen
    found = [find_jump(chosen.solved, k) for k in range(len(logs))]
    for _ in range(JUMP_ROUNDS if any(found) else 0):
        plain = [log if one is None else take_off_jump(log, *one) for log, one in zip(logs, found, strict=True)]
        try:
            again = choose_among_kinds(replace(experiment, logs=plain))
        except DataError:  # what a log without a jump shows is no reason to refuse it
            return experiment, chosen
        more = [0.0 if one is None else jump_size(again.solved, k, one[0]) for k, one in enumerate(found)]
        if not any(one and abs(step) > JUMP_SETTLED * abs(one[1]) for one, step in zip(found, more, strict=True)):
            break
        found = [one and (one[0], one[1] + step) for one, step in zip(found, more, strict=True)]
    if again is chosen or again.solved.cost > (1 - MUCH) * chosen.solved.cost:
        return experiment, chosen
    return replace(experiment, logs=plain), again


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
    again = choose_among_kinds(replace(experiment, logs=plain))
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
        again = choose_among_kinds(replace(experiment, logs=plain))
        more = find_gain_drift(again.tried, SURE_GAIN)
        if more is None:
            break
        total = total + more
    if again.solved.cost > chosen.solved.cost:  # what explained it was none
        return _choose_beside_gains(experiment, chosen)
    rows = zip(experiment.logs, (100 * total).tolist(), strict=True)
    told = [finding("gain-drifts", log.name, pct=pct) for log, pct in rows if abs(pct) > 100 * LEAST_GAIN]
    return replace(again, findings=[*again.findings, *told])


def _choose_beside_gains(experiment: Experiment, chosen: Chosen) -> Chosen:
    """The plant of logs whose engagements have gains of their own: chosen and fitted without these, as their squares
    hide how the plant goes."""
    alike = without_gains(chosen.tried[-1], experiment.logs) or without_gains(chosen.solved, experiment.logs)
    if not alike:
        return chosen
    try:
        again = choose_among_kinds(replace(experiment, logs=alike))
    except DataError:  # what a log without its gains shows is no reason to refuse it
        return chosen
    recorded = [replace(log, output=one.output) for log, one in zip(again.logs, experiment.logs, strict=True)]
    return replace(again, solved=fit_beside_gains(again.solved, recorded), logs=tuple(recorded), clutch=None)
