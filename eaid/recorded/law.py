"""The law behind the duty of a recorded loop, and the loop that it makes of a fitted model.

Δu_k = K_P Δe_k + K_I dt e_(k−1) by least squares over the rows off the limits: exact for a PI that does not wind up.
"""

from dataclasses import dataclass, replace

import numpy as np

from eaid.arrays import Array
from eaid.control.pi import PIGains
from eaid.estimate.from_logs import Solved, idle_of, model_of
from eaid.estimate.record import RecordedLog
from eaid.models.parameters import Nonlinear
from eaid.options import Rig
from eaid.replay.controllers import Controller, pi_controller
from eaid.replay.loop import Inputs, loop_of, reference_rate
from eaid.replay.plant import plant_parameters
from eaid.replay.rig import rig_numbers

LAW_PCT = 80.0
"""A law that explains less of the duty's changes is none."""


@dataclass(frozen=True, eq=False)
class Law:
    """A PI that explains a recorded duty."""

    gains: PIGains
    fit_pct: float
    first: int
    """Row at which the loop was closed."""


def run_loop(
    model: Nonlinear, controller: Controller, reference: Array, dt_s: float, share: Array, added: Array
) -> tuple[Array, Array]:
    """Duty [%] and read torque [N·m] of a loop, from rest, whose reading is T (1 + share) + added; shapes (n,)."""
    n = len(reference)
    columns = [[0.0] * n for _ in range(6)]
    rate = reference_rate(reference, dt_s, controller.looks_ahead)
    inputs = Inputs(*(column.tolist() for column in (reference, rate, added, 1.0 + share)))
    numbers = rig_numbers(Rig(), dt_s)
    loop_of(controller.step)(
        controller.gains, controller.start, plant_parameters(model), numbers, dt_s, inputs, columns
    )
    return np.array(columns[2]), np.array(columns[1])


def law_of(log: RecordedLog) -> Law | None:
    """The PI law behind a log with a reference; None where none explains its duty."""
    law = nearest_law(log)
    explains = law is not None and law.fit_pct >= LAW_PCT and law.gains.K_P > 0 and law.gains.K_I > 0
    return law if explains else None


def nearest_law(log: RecordedLog) -> Law | None:
    """The PI that comes nearest to a log's duty; None without a reference or with too few rows off the limits."""
    if log.reference is None:
        return None
    u, e = log.input, log.reference - log.output
    acting = np.flatnonzero(u > 0)
    if len(acting) < 50:
        return None
    top = float(u.max())
    off = (u > 0) & (u < top * (1 - 1e-9))
    rows = np.flatnonzero(off[1:] & off[:-1]) + 1
    if len(rows) < 50:
        return None
    design = np.column_stack([e[rows] - e[rows - 1], log.dt_s[rows - 1] * e[rows - 1]])
    wanted = u[rows] - u[rows - 1]
    found = np.linalg.lstsq(design, wanted, rcond=None)[0]
    size = float(np.linalg.norm(wanted))
    fit_pct = 100 * (1 - float(np.linalg.norm(wanted - design @ found)) / size) if size > 0 else 0.0
    return Law(PIGains(float(found[0]), float(found[1]), 0.0, top), fit_pct, int(acting[0]))


def simulated(solved: Solved, index: int, log: RecordedLog, law: Law) -> RecordedLog:
    """The log that the loop of a law gives on the fitted model, without noise."""
    assert log.reference is not None
    n = len(log.input)
    dt_s = float(log.time_s[-1] - log.time_s[0]) / (n - 1)
    added = np.full(n, idle_of(solved, index) + (log.baseline or 0.0))
    duty, seen = np.zeros(n), added.copy()
    controller = pi_controller(law.gains)
    part = slice(law.first, n)
    duty[part], seen[part] = run_loop(
        model_of(solved), controller, np.asarray(log.reference[part]), dt_s, np.zeros(n - law.first), added[part]
    )
    return replace(log, input=duty, output=seen, idle_start=log.starts_idle)
