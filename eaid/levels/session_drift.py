"""An output that drifts from run to run of a session, as that of a clutch which warms up.

Runs of a level tell it, where the logs' clock tells their order: of their ln T_s about their level's mean, d, and their
instants about the mean instant of the level, t,

    d = b t + e,    b = Σ t d/Σ t²

A t test asks whether it is one. Levels that were recorded one after another differ by b times what lies between them,
which no model tells from T_s(u).
"""

from collections.abc import Sequence

import numpy as np
from scipy.special import stdtr

from eaid.arrays import median
from eaid.estimate.own_level import gain_shifts
from eaid.estimate.scatter import Scatter
from eaid.findings import Finding, finding
from eaid.steps.noise import fit_line
from eaid.steps.stepset import RunRecord

RUN_DRIFT_CHANCE = 5e-3  # That runs which scatter alone look like a drift
LEAST_DRIFT_PCT = 2.0  # Over the whole session
ONE_AFTER_ANOTHER = 0.7  # Correlation of levels with their instants from which they were recorded in order


def session_drift(scatter: Scatter, runs: Sequence[RunRecord]) -> list[Finding]:
    """Said where runs of levels drift; nothing where no clock tells when each was recorded."""
    at_s = {(run.level, run.name): run.step_s for run in runs if run.edge == "rising" and not run.left_out}
    known = [[at_s.get((level.level, name)) for name in level.names] for level in scatter.levels]
    if not all(at is not None for each in known for at in each):
        return []
    instants = [np.array(each, dtype=np.float64) for each in known]
    order, record_s = np.sort(np.concatenate(instants)), median([float(one.time_s[-1]) for one in scatter.levels])
    if len(order) < 2 or np.diff(order).min() < 0.5 * record_s:  # each log has a clock of its own
        return []
    t = np.concatenate([each - each.mean() for each in instants])
    d = np.concatenate([gain_shifts(one, J[:, 0]) for one, J in zip(scatter.levels, scatter.jacobians, strict=True)])
    spare = len(t) - len(instants) - 1
    if spare < 1 or not t.any():
        return []
    b, error, _ = fit_line(t, d, taken=len(instants) + 1)  # both are about the mean of their level
    pct = 100 * float(np.expm1(b * (order[-1] - order[0])))
    chance = 2 * float(stdtr(spare, -abs(b) / max(error, 1e-300)))
    if chance > RUN_DRIFT_CHANCE or abs(pct) < LEAST_DRIFT_PCT:
        return []
    when = np.array([each.mean() for each in instants])
    ordered = len(when) > 2 and abs(float(np.corrcoef(when, scatter.duty)[0, 1])) > ONE_AFTER_ANOTHER
    return [finding("session-drifts", "data", (), pct=pct, chance=chance, ordered=bool(ordered))]
