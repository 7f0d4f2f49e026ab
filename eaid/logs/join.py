"""Several logs of one run, cut by the logger → one run, by time."""

import itertools
import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from eaid.arrays import Array, read_only
from eaid.errors import DataError
from eaid.findings import Finding, finding
from eaid.logs.run import Run


def joined(runs: Sequence[Run]) -> list[Run]:
    """Runs of one level and repeat (as their names say; all, where they say nothing) joined by time.

    Raises DataError where two overlap in time, or differ in what they hold.
    """
    groups: dict[tuple[float | None, int | None], list[Run]] = {}
    for run in runs:
        groups.setdefault((run.level, run.repeat), []).append(run)
    return [_one(sorted(members, key=lambda run: run.start_s)) for members in groups.values()]


def _one(parts: list[Run]) -> Run:
    first = parts[0]
    if len(parts) == 1:
        return first
    for before, after in itertools.pairwise(parts):
        end, start = before.start_s + float(before.time_s[-1]), after.start_s
        if start <= end:
            again = "; each begins its clock anew" if start == before.start_s else ""
            raise DataError(
                f"{after.where}: begins at {start:.6g} s, before {before.where} ends ({end:.6g} s){again}; "
                f"logs of one run must follow each other in time to be joined"
            )
        for what in ("input_unit", "output_unit"):
            if getattr(before, what) != getattr(after, what):
                raise DataError(
                    f"{after.where}: its {what.replace('_', ' ')} is not that of {before.where}; join like logs"
                )
    return replace(
        first,
        name=re.sub(r"[-_. ]?(part)?[-_. ]?0*1$", "", first.name) or first.name,
        time_s=read_only(np.concatenate([part.time_s + (part.start_s - first.start_s) for part in parts])),
        input=read_only(np.concatenate([part.input for part in parts])),
        output=read_only(np.concatenate([part.output for part in parts])),
        reference_nm=_beside([part.reference_nm for part in parts]),
        position=_beside([part.position for part in parts]),
        findings=(*_each(parts), finding("logs-joined", first.name, others=_listed(parts[1:]))),
    )


def _beside(columns: Sequence[Array | None]) -> Array | None:
    """A column that not every log has, joined where all do."""
    held = [column for column in columns if column is not None]
    return read_only(np.concatenate(held)) if len(held) == len(columns) else None


def _each(parts: Sequence[Run]) -> list[Finding]:
    """The findings of all parts, each once."""
    found: list[Finding] = []
    for part in parts:
        found.extend(one for one in part.findings if one not in found)
    return found


def _listed(parts: Sequence[Run]) -> str:
    others = ", ".join(f"{part.source} ({part.sha256[:12]})" for part in parts[:3])
    return f"{others} and {len(parts) - 3} more" if len(parts) > 3 else others
