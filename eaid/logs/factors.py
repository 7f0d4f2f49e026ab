"""Factors in the names of logs, `_V=300_f=1000_w=2`: which logs are meant, and what else than the level differs."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeVar

from eaid.errors import UsageError
from eaid.findings import Finding, finding
from eaid.logs.run import Run
from eaid.logs.units import COUNTERS
from eaid.shown import listed

T = TypeVar("T")
_NUMBER = r"[+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?"
_FACTOR = re.compile(rf"(?<![A-Za-z])([A-Za-z]+)=({_NUMBER}[A-Za-zµ%]*|[A-Za-z]+)")
REPEATS = COUNTERS | {"rep", "repeat", "run", "trial", "test", "date", "time"}
MOST_VALUES = 6  # Different values beyond which a factor counts the logs, and is none of the rig


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
    return kept or chosen([(file, file.name) for file in files], where)


def chosen(items: Sequence[tuple[T, str]], where: Mapping[str, str]) -> list[T]:
    """Those whose names say all of `where`; UsageError where there are none."""
    wanted = {key: shortest(value) for key, value in where.items()}
    kept = [one for one, name in items if wanted.items() <= factors_of(name).items()]
    if items and not kept:
        said = sorted({f"{key}={value}" for _, name in items for key, value in factors_of(name).items()})
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
            found.append(finding("several-factors", "data", key=key, values=tuple(values), first=values[0]))
    return found
