"""Fits, or one plain table, as sessions: what each says of T_s, τ1, τ2, B and a0, and whether they belong together."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import stdtrit

from eaid.errors import DataError
from eaid.findings import Finding
from eaid.results import codec
from eaid.results.common import Input, Number, Positive, Result
from eaid.results.fit import Fit

if TYPE_CHECKING:
    import pandas

ALIKE = 0.005  # Part of a level by which it may differ from session to session and still be the same
LEAST = 3  # Sessions that tell how much they differ
COLUMNS = ("session", "level", "value", "sd_log")
# What a file name says of drive and stand → how it is called; levels, which change within a session, are no such thing
NAMED = {"f": "drive frequency", "freq": "drive frequency", "v": "speed", "speed": "speed", "rpm": "speed"}
DRIVE = {"pwm_hz": "drive frequency", "voltage_v": "drive voltage"}


class Value(Result, frozen=True):
    """One value of a session at a level, and the standard deviation that its own fit leaves of its logarithm."""

    session: str
    level: Positive
    value: Positive
    sd_log: Number
    dof: Number = 1e9
    """Degrees of freedom of that."""


class Session(Result, frozen=True):
    """One session: its name, and the logs behind it."""

    name: str
    logs: tuple[Input, ...] = ()


def values_of(fit: Fit, name: str, session: str) -> tuple[Value, ...]:
    """What a fit says of T_s, τ1, τ2 or B at its levels, or of a0; what its data leave open, and has no interval, not."""
    if name == "a0":
        rows = [(1.0, fit.linear)] if fit.linear is not None else []  # it belongs to all levels
    elif name == "B":
        rows = [(row.level, row) for row in (fit.linear.per_level if fit.linear is not None else ())]
    else:
        levels = [row for row in fit.friction_levels if row.from_ == 0]
        rows = [(row.level, row) for row in levels or (fit.nonlinear.curves if fit.nonlinear is not None else ())]
    found = []
    for level, row in rows:
        value, ends = getattr(row, name), getattr(row.ci95, name, None)
        if ends is None or not (value and level > 0 and 0 < ends[0] <= value <= ends[1]):
            continue
        dof = min(row.ci95.dof.get(name) or 1e9, 1e9)
        found.append(Value(session, level, value, float(np.log(ends[1] / ends[0]) / 2 / stdtrit(dof, 0.975)), dof))
    return tuple(found)


def run_scatter(fit: Fit, name: str) -> float | None:
    """Standard deviation of ln θ from run to run, where the fit knows it."""
    noise = fit.uncertainty.noise if fit.uncertainty is not None else None
    scatter = noise.scatter if noise is not None else {}
    parts = {"B": ("Ts", "tau1"), "a0": ("tau1",)}.get(name, (name,))
    known = [scatter[one] for one in parts if scatter.get(one)]
    return float(np.hypot.reduce(known)) if known else None


def snapped(values: Sequence[Value]) -> tuple[Value, ...]:
    """Levels that are nearly alike made the same."""
    from msgspec.structs import replace

    levels = np.unique([one.level for one in values])
    group = np.cumsum(np.append(0, np.diff(np.log(levels)) > ALIKE)) if len(levels) else levels
    same = {float(u): float(f"{np.median(levels[group == g]):.4g}") for u, g in zip(levels, group, strict=True)}
    if len(set(group.tolist())) == len(levels):
        return tuple(values)
    return tuple(replace(one, level=same[one.level]) for one in values)


def session_of(name: str, fit: Fit) -> Session:
    """A fit as a session."""
    logs = dict.fromkeys((one.path, one.sha256) for one in fit.data.sources)
    return Session(name, tuple(Input(*one) for one in logs))


def together(fits: Mapping[str, Fit]) -> None:
    """DataError where fits are of other units, kind, drive or stand than the first, or have a log in common."""
    faults, (first, *others) = [], list(fits)
    for name in others:
        differ = [
            f"{what} {a or 'none'} and {b or 'none'}"
            for (what, a), (_, b) in zip(_conditions(fits[first]), _conditions(fits[name]), strict=True) if a != b
        ]  # fmt: skip
        if differ:
            faults.append(
                f"{name}: is not of the same rig as {first}: {'; '.join(differ)}; only what the rig does by itself may "
                "differ from session to session"
            )
    seen: dict[str, tuple[str, str]] = {}
    for name, fit in fits.items():
        for path, sha256 in dict.fromkeys((one.path, one.sha256) for one in fit.data.sources if one.sha256):
            before, where = seen.setdefault(sha256, (name, path))
            if before != name:
                faults.append(f"{name}: holds {path}, which {before} holds too ({where}); a log is of one session")
    if faults:
        raise DataError(*faults)


def _conditions(fit: Fit) -> list[tuple[str, str]]:
    """What has to be the same for all sessions."""
    data, rig = fit.data, fit.data.apparatus
    said = [("kind", data.kind), ("input unit", data.input_unit), ("output unit", data.output_unit)]
    for one in fields(rig):
        if one.name != "sample_rate_hz":
            said.append((DRIVE.get(one.name, one.name), f"{getattr(rig, one.name):g}"))
    named: dict[str, set[str]] = {}
    for source in data.sources:
        for key, number in re.findall(r"(?<![A-Za-z])([A-Za-z]+)=(\d+(?:\.\d+)?)", source.run):
            named.setdefault(key, set()).add(number)
    return said + [(f"{what} ({key}= in the names)", ", ".join(sorted(named.get(key, ())))) for key, what in NAMED.items()]


def table_values(frame: "pandas.DataFrame") -> tuple[Value, ...]:
    """The values of a plain table with the columns session, level, value, sd_log; DataError for one that is none."""
    missing = [name for name in COLUMNS if name not in frame.columns]
    if missing:
        raise DataError(f"the table has no column {missing[0]}; give {', '.join(COLUMNS)}, a value a row")
    found, faults = [], []
    for place, (session, level, value, sd_log) in enumerate(zip(*(frame[one] for one in COLUMNS), strict=True), 1):
        try:
            numbers = [float(one) for one in (level, value, sd_log)]
        except (TypeError, ValueError):
            numbers = [np.nan]
        if session != session or not (np.isfinite(numbers).all() and min(numbers[:2]) > 0 and numbers[2] >= 0):
            faults.append(
                f"row {place} of the table ({session}, {level}, {value}, {sd_log}): level and value have to be above 0, "
                "sd_log 0 or above, as the model is one of logarithms; mend or drop it"
            )
        else:
            found.append(Value(str(session), *numbers))
    if faults:
        raise DataError(*faults[:5])
    return tuple(found)


def read_sessions(paths: Sequence[Path]) -> "tuple[dict[str, Fit], tuple[Value, ...], tuple[Finding, ...]]":
    """Files of fits by their names, or the values of one table; and what is to be told of the files."""
    if len(paths) == 1 and paths[0].suffix.lower() not in (".json", ""):
        import pandas as pd

        if not paths[0].is_file():
            raise DataError(f"{paths[0]}: no such file; give files of fits, or one table {','.join(COLUMNS)}")
        try:
            return {}, table_values(pd.read_csv(paths[0], comment="#", skipinitialspace=True)), ()
        except (DataError, ValueError) as fault:
            raise DataError(*(f"{paths[0]}: {one}" for one in getattr(fault, "sentences", (str(fault).splitlines()[0],)))) from None
    fits, told = list[Fit](), list[Finding]()
    for path in paths:
        fit, found = codec.read(path, Fit)
        fits.append(fit)
        told += found
    return dict(zip(names_of(paths), fits, strict=True)), (), tuple(told)


def names_of(paths: Sequence[Path]) -> list[str]:
    """What sessions are called: their files without ending, whole where two are alike."""
    stems = [path.stem for path in paths]
    return stems if len(set(stems)) == len(stems) else [str(path) for path in paths]
