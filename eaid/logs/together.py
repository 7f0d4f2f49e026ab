"""What several logs are together: one of them given twice, one on another scale than the rest, parts of one run.

Parts of one run, cut by the logger, are joined by time.
"""

import itertools
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from eaid.arrays import Array, read_only
from eaid.errors import DataError
from eaid.findings import Finding, finding
from eaid.logs.run import Run
from eaid.shown import counted, listed


def counted_once(runs: Sequence[Run]) -> list[Run]:
    """Runs without those of a log that was read already, from a copy or a dataset; the one that stays says so."""
    first: dict[str, str] = {}
    again: dict[str, set[str]] = {}
    kept = []
    for run in runs:
        holder = run.dataset or run.source
        if run.sha256 and first.setdefault(run.sha256, holder) != holder:
            again.setdefault(run.sha256, set()).add(holder)
        else:
            kept.append(run)
    for i, run in enumerate(kept):
        if others := again.pop(run.sha256, None):
            said = finding("log-given-twice", run.name, path=", ".join(sorted(others)), first=first[run.sha256])
            kept[i] = replace(run, findings=(*run.findings, said))
    return kept


UNLIKE = 1.5
"""Ratio of swings beyond which outputs are no repeats."""


def levels_in_names(runs: Sequence[Run]) -> None:
    """Raise DataError where the inputs say only on or off, but outputs and numbers in the logs' names differ.

    Taken as they are, logs of different levels would count as repeats of one.
    """
    switched = [run for run in runs if _switched(run)]
    swings = [float(np.ptp(np.nanquantile(run.output, (0.02, 0.98)))) for run in switched]
    if len(switched) < 2 or max(swings) < UNLIKE * min(swings):
        return
    if (pattern := differing_number([run.name for run in switched])) is None:
        return
    taken = dict(switched[0].taken)["input"]
    raise DataError(
        f"{switched[0].source} and {len(switched) - 1} more: {taken} says only on or off, and the names of the logs "
        f'differ in a number; say that it is the level with «name_pattern» "{pattern}", or that 1 is the level of all '
        f'with «columns» input="{taken}"'
    )


def _switched(run: Run) -> bool:
    guessed = any(one.code in ("input-unnamed", "input-by-its-steps") for one in run.findings)
    return guessed and not run.dataset and run.level is None and set(np.unique(run.input)) <= {0.0, 1.0}


def differing_number(names: Sequence[str]) -> str | None:
    """The first number in which some names differ as a pattern: `test_{level}V_`; None where they are not alike.

    Names count as alike where they differ in their numbers only.
    """
    parts = [re.split(r"(\d+(?:\.\d+)?)", name) for name in names]
    if len({tuple(one[::2]) for one in parts}) != 1:
        return None
    for k in range(1, len(parts[0]), 2):
        if len({one[k] for one in parts}) > 1:
            return f"{parts[0][k - 1]}{{level}}{parts[0][k + 1]}"
    return None


def scales_compared(runs: Sequence[Run]) -> list[Run]:
    """Runs in %; one that stays within 1 while others go to 100 is a fraction, and says so.

    Those of datasets were compared when they were ingested.
    """
    largest = [_largest_pct(run) for run in runs]
    most = np.nanmax(largest) if not np.isnan(largest).all() else 0.0
    if not most > 1.5:
        return list(runs)
    others = {round(one, 3) for one in largest if one > 1.5}
    compared = []
    for run, top in zip(runs, largest, strict=True):
        if 0 < top < 1 or (top == 1 and 100.0 in others):
            run = replace(run, findings=(*run.findings, finding("input-in-fractions", run.name, other=float(most))))
        compared.append(run)
    return compared


def _largest_pct(run: Run) -> float:
    """The largest input of a log in %; NaN for any other."""
    in_pct = run.input_unit == "%" and not run.dataset and len(run.input) > 0
    return float(np.abs(run.input).max()) if in_pct else np.nan


def columns_told(runs: Sequence[Run]) -> list[str]:
    """Which columns were taken of logs, and which were left, a sentence for all logs that are alike."""
    alike: Counter[tuple[str, str]] = Counter()
    for run in runs:
        if run.taken:
            units = {"time": "s", "input": run.input_unit, "output": run.output_unit, "position": run.position_unit}
            taken = [f"{role} = {name} [{units.get(role) or '?'}]" for role, name in run.taken]
            alike[", ".join(taken), ", ".join(run.left) or "none"] += 1
    return [f"columns of {counted(n, 'log')}: {taken}; left: {left}" for (taken, left), n in alike.items()]


def named_apart(runs: Sequence[Run]) -> list[Run]:
    """Runs with names of their own: the folder's name before a name that comes twice, then a number behind it."""
    counts = Counter(run.name for run in runs)
    apart = [
        replace(run, name=f"{Path(run.source).resolve().parent.name}-{run.name}") if counts[run.name] > 1 else run
        for run in runs
    ]
    seen: Counter[str] = Counter()
    for i, run in enumerate(apart):
        seen[run.name] += 1
        if seen[run.name] > 1:
            apart[i] = replace(run, name=f"{run.name}-{seen[run.name]}")
    return apart


def joined(runs: Sequence[Run]) -> list[Run]:
    """Runs of one level and repeat (as their names say; all, where they say nothing) joined by time.

    Raises DataError where two overlap in time, or differ in what they hold.
    """
    groups: dict[tuple[float | None, int | None], list[Run]] = {}
    for run in runs:
        groups.setdefault((run.level, run.repeat), []).append(run)
    return [_joined(sorted(members, key=lambda run: run.start_s)) for members in groups.values()]


def _joined(parts: list[Run]) -> Run:
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
    others = [f"{part.source} ({part.sha256[:12]})" for part in parts[1:]]
    return replace(
        first,
        name=re.sub(r"[-_. ]?(part)?[-_. ]?(?<!\d)0*1$", "", first.name) or first.name,
        time_s=read_only(np.concatenate([part.time_s + (part.start_s - first.start_s) for part in parts])),
        input=read_only(np.concatenate([part.input for part in parts])),
        output=read_only(np.concatenate([part.output for part in parts])),
        reference_nm=_beside([part.reference_nm for part in parts]),
        position=_beside([part.position for part in parts]),
        findings=(*_findings_of(parts), finding("logs-joined", first.name, others=listed(others, 3))),
    )


def _beside(columns: Sequence[Array | None]) -> Array | None:
    """A column that not every log has, joined where all do."""
    present = [column for column in columns if column is not None]
    return read_only(np.concatenate(present)) if len(present) == len(columns) else None


def _findings_of(parts: Sequence[Run]) -> list[Finding]:
    """The findings of all parts, each once."""
    found: list[Finding] = []
    for part in parts:
        found.extend(one for one in part.findings if one not in found)
    return found
