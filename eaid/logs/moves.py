"""The rule that says which logs are fitted as they were recorded: those whose input does more than step from rest."""

import numpy as np

from eaid.logs.run import Run

QUIET = 0.02
"""An input below this part of its largest is at rest."""
APART = {"%": 0.02}
"""Part of the largest input by which two inputs differ: a commanded duty is exact …"""
MEASURED = 0.1
"""… and a measured input wanders."""
AWAY = 0.05
"""A stretch under load that spends more than this part of its time away from its own middle is no step."""
RETURNS = 4
"""So many falls to rest make a recording of its own, where the rests are shorter than the holds."""


def is_recorded(run: Run, rest: float = 0.0) -> bool:
    """Whether a log is fitted as it was recorded, for its input does more than step from rest.

    It does where a stretch under load goes through different inputs, or where it falls to rest again and again with
    rests shorter than the holds between. Runs whose level or step instant was said, and steps cut out of a log, are
    steps; so are logs of the friction rig.
    """
    if run.cut or run.level is not None or run.step_s is not None or run.until_s is not None:
        return False
    if run.kind not in (None, "clutch") or len(run.input) < 10 or not np.isfinite(run.input).all():
        return False
    level = np.abs(run.input - rest)
    top = float(level.max())
    loaded = level > QUIET * top
    if top == 0.0 or (loaded.all() and np.ptp(level) <= QUIET * top):
        return False
    edges = np.flatnonzero(np.diff(np.concatenate([[0], loaded.astype(int), [0]])))
    starts, ends = edges[::2], edges[1::2]
    apart = APART.get(run.input_unit, MEASURED) * top
    away = sum(
        int((np.abs(level[a:b] - np.median(level[a:b])) > apart).sum()) for a, b in zip(starts, ends, strict=True)
    )
    if away > AWAY * int(loaded.sum()):
        return True
    if len(starts) <= RETURNS:
        return False
    holds, rests = ends - starts, starts[1:] - ends[:-1]
    return bool(np.median(rests) < np.median(holds) and np.median(holds) >= 5)
