"""Several logs of one run, cut by the logger → one run, by time."""

import itertools
import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from eaid.arrays import read_only
from eaid.errors import DataError
from eaid.logs.run import Run


def joined(runs: Sequence[Run]) -> list[Run]:
    """Runs of one level and repeat (as their names say; all, where they say nothing) joined by time.

    Raises DataError where two overlap in time, or differ in what they hold.
    """
    groups: dict[tuple[float | None, int | None], list[Run]] = {}
    for run in runs:
        groups.setdefault((run.level, run.repeat), []).append(run)
    return [_one(sorted(members, key=lambda run: float(run.time_s[0]))) for members in groups.values()]


def _one(parts: list[Run]) -> Run:
    first = parts[0]
    if len(parts) == 1:
        return first
    for before, after in itertools.pairwise(parts):
        end, start = float(before.time_s[-1]), float(after.time_s[0])
        if start <= end:
            again = "; each begins its clock anew" if start == float(before.time_s[0]) else ""
            raise DataError(
                f"{after.where}: begins at {start:.6g} s, before {before.where} ends ({end:.6g} s){again}; "
                f"logs of one run must follow each other in time to be joined"
            )
        for what in ("input_unit", "output_unit"):
            if getattr(before, what) != getattr(after, what):
                raise DataError(
                    f"{after.where}: its {what.replace('_', ' ')} is not that of {before.where}; join like logs"
                )
    references = [part.reference_nm for part in parts]
    return replace(
        first,
        name=re.sub(r"[-_. ]?(part)?[-_. ]?0*1$", "", first.name) or first.name,
        time_s=read_only(np.concatenate([part.time_s for part in parts])),
        input=read_only(np.concatenate([part.input for part in parts])),
        output=read_only(np.concatenate([part.output for part in parts])),
        reference_nm=None
        if any(reference is None for reference in references)
        else read_only(np.concatenate([reference for reference in references if reference is not None])),
        notes=(*dict.fromkeys(note for part in parts for note in part.notes), _told(parts)),
    )


def _told(parts: Sequence[Run]) -> str:
    others = ", ".join(f"{part.source} ({part.sha256[:12]})" for part in parts[1:4])
    more = f" and {len(parts) - 4} more" if len(parts) > 4 else ""
    return f"joined with {others}{more}"
