"""What the names of logs tell: level and repeat by a pattern, and factors, `_V=300_f=1000_w=2`.

Factors say which logs are meant, and what else than the level differs.
"""

import contextlib
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np

from eaid.errors import DataError, UsageError
from eaid.findings import Finding, finding
from eaid.logs.run import Run
from eaid.logs.units import COUNTERS
from eaid.shown import listed

PathOrRun = TypeVar("PathOrRun", Path, Run)
_NUMBER = r"[+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?"
_FACTOR = re.compile(rf"(?<![A-Za-z])([A-Za-z]+)=({_NUMBER}[A-Za-zµ%]*|[A-Za-z]+)")
REPEATS = COUNTERS | {"rep", "repeat", "run", "trial", "test", "date", "time"}
MOST_VALUES = 6  # Different values beyond which a factor counts the logs, and is none of the rig
_BEFORE = re.compile(r"\d[.,ep_-]?$", re.IGNORECASE)
# What stands beside a number that may be a part of a longer one: 2-5V, 2p5V, 1e2V, 2_5V, 1,000V
_AFTER = re.compile(r"[.,]?\d|[ep-][+-]?\d|_\d{1,3}(?!\d)", re.IGNORECASE)
_DATED = re.compile(r"(\d{4}([-_.]?)\d\d\2\d\d|\d\d[-_.]\d\d[-_.]\d{4})[-_]$")
# Units of inputs as they stand in names beside a level: V=100, 60pct; lower-case letters stand for much else
_LEVELS = "V|kV|mV|mA|A|N|kN|bar|kPa|MPa|rpm|RPM|pct|%"
_COUNTS_RUNS = re.compile(r"(?<![A-Za-z])(r|n|no|nr|run|rep|repeat|trial|test|take)[_-]?$", re.IGNORECASE)


def factors_of(name: str) -> dict[str, str]:
    """Each `key=value` of a name, its number at its shortest: 1000, 1000.0 and 1e3 are one."""
    return {key: shortest(value) for key, value in _FACTOR.findall(name)}


def shortest(value: str) -> str:
    """A value whose number, where it begins with one, is written in one way."""
    return re.sub(rf"^{_NUMBER}", lambda found: f"{float(found[0]):.12g}", value)


def agreeing(files: Sequence[Path], where: Mapping[str, str]) -> list[Path]:
    """Files whose names do not say otherwise: those within a dataset are looked at when it is read."""
    wanted = {key: shortest(value) for key, value in where.items()}
    kept = [file for file in files if wanted.items() <= {**wanted, **factors_of(file.name)}.items()]
    return kept or named_like(files, where)


def named_like(items: Sequence[PathOrRun], where: Mapping[str, str]) -> list[PathOrRun]:
    """Those whose names say all of `where`; UsageError where there are none."""
    wanted = {key: shortest(value) for key, value in where.items()}
    kept = [one for one in items if wanted.items() <= factors_of(one.name).items()]
    if items and not kept:
        said = sorted({f"{key}={value}" for one in items for key, value in factors_of(one.name).items()})
        told = ", ".join(f"{key}={value}" for key, value in where.items())
        raise UsageError(f"«where» {told}: no name says so; they say {listed(said, 8) or 'nothing'}")
    return kept


def several_factors(runs: Sequence[Run]) -> list[Finding]:
    """What else than the level and the repeat differs between the names of runs."""
    rising = [run for run in runs if run.level is not None and run.edge != "falling"]
    told = [factors_of(run.name) for run in rising]
    found = []
    for key in sorted({key for each in told for key in each if key.lower() not in REPEATS}):
        values = sorted({each[key] for each in told if key in each})
        levels = {f"{abs(run.level or 0.0):.12g}" for run in rising}
        if 1 < len(values) <= MOST_VALUES and not {re.sub(r"[^\d.]", "", one) for one in values} <= levels:
            one = len(levels) == 1 and all(run.has_input for run in rising)
            found.append(finding("several-factors", "data", key=key, values=tuple(values), first=values[0], one=one))
    return found


def level_and_repeat(source: str, pattern: str | None, name: str) -> tuple[float | None, int | None]:
    """Level and repeat that the name of a log tells, the pattern being found anywhere in it.

    Raises DataError where the number that stands for the level may be a part of a longer one.
    """
    if pattern is None:
        return None, None
    parts = re.split(r"\{(level|repeat)\}", pattern)
    forms = {"level": r"(?P<level>[+-]?(?:\d+(?:[.,]\d+)?|\.\d+))", "repeat": r"(?P<repeat>\d+)"}
    every = re.finditer("".join(forms[part] if i % 2 else re.escape(part) for i, part in enumerate(parts)), name)
    match = next(every, None)
    if match is None:
        return None, None
    told = match.groupdict()
    level, repeat = told.get("level"), told.get("repeat")
    if repeat is not None and int(repeat) > np.iinfo(np.int64).max:
        raise DataError(f"{source}: its repeat, {repeat}, is no count; mend «name_pattern», or rename the log")
    if level is None:
        return None, None if repeat is None else int(repeat)
    begins = match.end("repeat") if repeat is not None and match.start("repeat") < match.start("level") else 0
    ends = pattern.endswith("{level}") and _AFTER.match(name[match.end("level") :])  # else the pattern says where
    before = name[begins : match.start("level")]
    longer = _BEFORE.search(before) and not _DATED.search(before)
    thousands = re.fullmatch(r"[+-]?[1-9]\d{0,2},\d{3}", level)
    if longer or ends or thousands or any(other["level"] != level for other in every):
        raise DataError(
            f"{source}: {level} in its name may not be the whole level, or not the only one; rename it, as in 2.5V, or "
            f"let «name_pattern» hold what stands beside it, as in {{repeat}}_{{level}}V"
        )
    return float(level.replace(",", ".")), None if repeat is None else int(repeat)


def unit_beside(pattern: str) -> str:
    """The unit that a name pattern holds beside its level; empty where it holds none."""
    found = re.search(rf"(?:^|[^A-Za-z])({_LEVELS})=?\{{level\}}|\{{level\}}({_LEVELS})(?![A-Za-z])", pattern)
    return found[1] or found[2] if found else ""


def pattern_guessed(names: Sequence[str]) -> str:
    """A name pattern with the number that tells the names apart and has a letter beside it; empty where there is none.

    Of several the one beside a unit, then the one before letters, or behind an equals sign, whose values come equally
    often. A number that all names share counts only beside a unit, and where no other does.
    """
    pieces = [re.split(r"(\d+(?:\.\d+)?)", name) for name in names]
    patterns = []
    for k in range(1, len(pieces[0]), 2) if len({tuple(one[::2]) for one in pieces}) == 1 else ():
        texts, counts = pieces[0], Counter(one[k] for one in pieces)
        (before,) = re.findall(r"[_\s-]?[^_\s-]*$", texts[k - 1])[:1]
        (after,) = re.findall(r"^[^_\s-]*[_\s-]?", texts[k + 1])
        unit = unit_beside(f"{before}{{level}}{after}")
        if (len(counts) < 2 and not unit) or _COUNTS_RUNS.search(before) or not re.search("[A-Za-z]", before + after):
            continue
        for pattern in (f"{before}{{level}}{after}", f"{texts[k - 3][-3:]}{{repeat}}{texts[k - 1]}{{level}}{after}"):
            with contextlib.suppress(DataError):
                if all(level_and_repeat("", pattern, name)[0] is not None for name in names):
                    no_unit = not re.match("[A-Za-z%]", after) and not before.endswith("=")
                    uneven = max(counts.values()) - min(counts.values())
                    patterns.append((len(counts) < 2, not unit, no_unit, uneven, pattern))
                    break
    return min(patterns)[-1] if patterns else ""
