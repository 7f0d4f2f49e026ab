"""Whether one set of logs was recorded in several sittings, between which a rig may have been mounted anew.

By the dates and times in the names, else by stamps on a calendar, else, in the order of the names, by a jump of the
idle output that is far beyond how it scatters on either side.
"""

import os
import re
import shlex
from collections.abc import Sequence
from datetime import UTC, datetime
from functools import partial

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array, link
from eaid.findings import Finding, finding
from eaid.steps.stepset import RunRecord

PAUSE_S = 3600.0  # A pause from which a rig may have been mounted anew
CALENDAR_S = 1e8  # Stamps from here on are seconds of a calendar, not of a log
IDLE_JUMP, JUMP_SHARE = 8.0, 0.05  # A jump of the idle: standard errors, and part of the usual output
LEAST_SITTINGS, MOST_PREFIXES = 2, 3
DATE = re.compile(
    r"(?<!\d)(20\d\d)[-_.]?(0[1-9]|1[0-2])[-_.]?(0[1-9]|[12]\d|3[01])"
    r"(?:[-_T .]*([01]\d|2[0-3])[-_:.h]?([0-5]\d)(?:[-_:.m]?([0-5]\d))?)?(?!\d)"
)


def sittings(runs: Sequence[RunRecord], usual: float, unit: str, options: str | None) -> list[Finding]:
    """The finding of several sittings; none where there is one. `usual`: output; `options` by which the logs were read,
    for a command for each part; None of a dataset."""
    every = [run for run in runs if run.edge == "rising" and not run.left_out]
    rising = list({run.source: run for run in reversed(every)}.values())  # the first of each log
    moments = [_moment(run) for run in rising]
    if all(at is not None for at in moments):
        order = np.argsort([at or 0.0 for at in moments], kind="stable")
        at = np.array([moments[k] or 0.0 for k in order])
        ends, by = np.flatnonzero(np.diff(at) > PAUSE_S) + 1, "by their dates"
    else:
        order = np.argsort([run.source for run in rising], kind="stable")
        ends, by = _jump(np.array([rising[k].baseline_nm for k in order]), usual), "by a jump of the idle output"
    if not len(ends):
        return []
    sources = [[rising[k].source for k in part] for part in np.split(order, ends)]
    groups = [sorted((run for run in every if run.source in part), key=lambda run: part.index(run.source))
              for part in sources]  # fmt: skip
    level = np.array([run.level for group in groups for run in group])
    sitting = np.repeat(np.arange(len(groups)), [len(group) for group in groups])
    apart = bool(link((level[:, None] == level) | (sitting[:, None] == sitting)).any())
    parts, n = tuple(_words(group, unit) for group in groups), len(groups)
    logs = () if options is None else _beginnings(groups)
    told = partial(finding, "several-sessions", "data", sessions=n, by=by)
    return [told(parts=parts, mixed=apart, logs=logs, options=options or "")]


def _moment(run: RunRecord) -> float | None:
    """When a run was recorded [s]; None where neither its name nor its stamps say it."""
    if found := DATE.search(os.path.basename(run.source) or run.name):
        year, month, day, hour, minute, second = (int(one or 0) for one in found.groups())
        try:
            return datetime(year, month, day, hour, minute, second, tzinfo=UTC).timestamp()
        except ValueError:  # the 31st of a month of 30 days
            return None
    return run.step_s if run.step_s > CALENDAR_S else None


def _jump(idle: Array, usual: float) -> NDArray[np.intp]:
    """Where, in the order of the names, the idle output jumps; nowhere by most sets."""
    best, at = 0.0, 0
    for k in range(LEAST_SITTINGS, len(idle) - LEAST_SITTINGS + 1):
        one, other = idle[:k], idle[k:]
        off = abs(float(one.mean() - other.mean()))
        spread = float(((one - one.mean()) ** 2).sum() + ((other - other.mean()) ** 2).sum()) / max(len(idle) - 2, 1)
        error = np.sqrt(spread * (1 / k + 1 / len(other))) + 1e-12 * usual
        if off > JUMP_SHARE * usual and off / error > max(best, IDLE_JUMP):
            best, at = off / error, k
    return np.array([at] if at else [], dtype=np.intp)


def _words(group: Sequence[RunRecord], unit: str) -> str:
    """`2024-10-29 16:18: 250 V`."""
    first = _moment(group[0])
    when = f"{os.path.basename(group[0].source)} …"
    if first is not None:
        when = f"{datetime.fromtimestamp(first, UTC):%Y-%m-%d %H:%M}"
    levels = ", ".join(f"{one:.4g}" for one in sorted({run.level for run in group}))
    return f"{when}: {levels} {unit}".rstrip()


def _beginnings(groups: Sequence[Sequence[RunRecord]]) -> tuple[str, ...]:
    """The logs of each part by the beginnings of their names; empty where these do not tell the parts."""
    parts = []
    for group in groups:
        others = [run.source for other in groups if other is not group for run in other]
        begins = dict.fromkeys(_beginning(run.source, others) for run in group)
        if len(begins) > MOST_PREFIXES or "" in begins:
            return ()
        parts.append(" ".join(f"{shlex.quote(one)}*" for one in begins))
    return tuple(parts)


def _beginning(path: str, others: Sequence[str]) -> str:
    """The shortest beginning of a path, in whole words and numbers, that none of the others has; empty: none."""
    name = os.path.basename(path)
    start = len(path) - len(name)
    for end in (start + found.end() for found in re.finditer(r"[A-Za-z]+|\d+", name)):
        if not any(one.startswith(path[:end]) for one in others):
            return path[:end]
    return ""
