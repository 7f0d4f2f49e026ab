"""Fits, or one plain table, as sessions: what each says of T_s, τ1, τ2, B, a0, what was held; do they go together?"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from msgspec.structs import replace
from scipy.special import stdtrit

from eaid.apparatus import Apparatus
from eaid.arrays import median
from eaid.errors import DataError
from eaid.estimate.scatter import CURVES, USUAL, USUAL_TAU, unit_variances
from eaid.findings import Finding, finding
from eaid.logs.names import factors_of
from eaid.plant.dynamics import Step
from eaid.results import codec
from eaid.results.common import Input, Number, Positive, Result
from eaid.results.fit import Fit
from eaid.results.models import CurveLevel, LevelIntervals
from eaid.results.plant import names_of
from eaid.shown import pandas

RIG_NAME = "the rig"  # What a fit of today is held against, which says itself what it foresees
NO_RIG = 30.0  # Factor between T_s of two sessions that is another unit: mountings differ by 4
LEVELS_SAME = 0.005  # Part of a level by which it may differ from session to session and still be the same
RESPONSES = ("held", "peak")  # Of those that were measured of a level, what sessions may differ in
WHOLE_NUMBERS = ("a0", "omega", "zeta", "dead_time_s")  # Numbers of all levels
# A dead time is another from so much of τ1 on, C and ζ from so much
LEAST_LATE, LEAST_APART_C, LEAST_APART_ZETA = 0.05, 0.03, 0.05
ASSUMED_DEGREES = 2.0  # Degrees of freedom of a scatter that was assumed: rigs have a half to twice of it
MANY = 1e9  # Degrees of freedom of what is known for certain
NO_INTERVAL = "no level has a T_s with an interval; fit the logs again, with «ci»"
EXACT = 1e-6  # Standard deviation of ln θ below which a value is known for certain
IMPOSSIBLE = 10.0  # Deviations by which two values of one session do not differ
# The numbers of a step by which runs of a number scatter
PARTS = {"Ts": ("Ts",), "tau1": ("tau1",), "tau2": ("tau2",), "B": ("Ts", "tau1")}
PLAIN_COLUMNS = ("session", "level", "value", "sd_log")
# What a file name says of drive and stand → how it is called; levels, which change within a session, are no such thing
NAMED = {"f": "drive frequency", "freq": "drive frequency", "v": "speed", "speed": "speed", "rpm": "speed"}
DRIVE = {"pwm_hz": "drive frequency", "voltage_v": "drive voltage"}


class SessionValue(Result, frozen=True):
    """One value of a session at a level; what its own fit leaves of the logarithm, as a standard deviation."""

    session: str
    level: Positive
    value: Positive
    sd_log: Number
    dof: Number = MANY


class Session(Result, frozen=True):
    """One session: its name, and the logs behind it."""

    name: str
    logs: tuple[Input, ...] = ()


def values_of_fit(fit: Fit, name: str, session: str, of_one_run: bool = False) -> list[SessionValue]:
    """A fit's T_s, τ1, τ2, B of its levels, what they held and their peaks, or what its plant has as a whole (of level
    1), as its data tell; those without an interval only where they may be `of_one_run`, as if they were certain."""
    linear, pooled = fit.linear, sum(max(one.runs - 1, 0) for one in fit.responses)
    most = ASSUMED_DEGREES if assumes_scatter(fit) else MANY
    rows: list[tuple[float, Any]] = [] if linear is None else [(1.0, linear)]
    if name != "a0" and of_whole_plant(fit, name):
        part = fit.another_plant
        value, ends = (None, None) if part is None or part.paced else part.numbers.get(name, (None, None))
        rows = [(1.0, SimpleNamespace(**{name: value}, ci95=SimpleNamespace(**{name: ends})))]
    elif name in RESPONSES:
        rows = [(row.level, row) for row in fit.responses]
    elif name != "a0":
        levels = fit.level_values if name != "B" else linear.per_level if linear is not None else ()
        rows = [(row.level, row) for row in levels] or (of_another_plant(fit) if name != "B" else [])
    found = []
    for level, row in rows:
        value, ends = getattr(row, name), getattr(row.ci95, name, None)
        if not value or value < 0 or level <= 0:
            continue
        if ends is not None and 0 < ends[0] <= value <= ends[1]:
            dof = min(getattr(row.ci95, "dof", {name: pooled}).get(name) or MANY, MANY)
            sd_log = float(np.log(ends[1] / ends[0]) / 2 / stdtrit(dof, 0.975))
            found.append(SessionValue(session, level, value, sd_log, min(dof, most)))
        elif of_one_run:
            found.append(SessionValue(session, level, value, 0.0))
    return found


def values_of_session(fit: Fit, name: str, session: str, of_runs: float | None) -> list[SessionValue]:
    """The same as sessions take them. Intervals of single runs hold what their levels scatter about a curve, which
    sessions show again: each value is known as its record's own noise tells, and `of_runs`, the deviation from run to
    run in other sessions; where none tells that, it is a part of what a level scatters from session to session."""
    values, about = values_of_fit(fit, name, session), fit.uncertainty
    if name not in PARTS or about is None or about.noise is None or not of_single_runs(fit):
        return values
    rows, density = {row.level: row for row in fit.level_values}, (about.noise.sensor_nm2_s, about.noise.ripple_s)
    records, found = dict(zip(fit.data.levels, fit.data.record_s, strict=True)), []
    for one in values:
        row = rows[one.level]
        curve = Step(row.Ts or 0.0, tau := row.tau1 or 0.0, row.tau2 or tau, fit.plant.C)
        own = np.sqrt(unit_variances(curve, records[one.level]) @ density)
        sd = [of_runs or 0.0, *(float(own[CURVES.index(part)]) for part in PARTS[name])]
        found.append(replace(one, sd_log=float(np.linalg.norm(sd)), dof=MANY))
    return found


def of_single_runs(fit: Fit) -> bool:
    """Whether no level of steps from rest has repeats."""
    return fit.uncertainty is not None and fit.uncertainty.scatter_from in ("curve", "within") and fit.recorded is None


def assumes_scatter(fit: Fit) -> bool:
    """Whether how runs scatter is assumed as usual, since single runs of few levels, or few engagements, do not show
    it."""
    return bool({"single-runs-few-levels", "engagements-few"} & {one.code for one in fit.findings})


def unseen_scatter(fit: Fit, name: str) -> float:
    """Standard deviation of ln θ that all values of a fit share by how engagements usually scatter, where a log holds
    too few to show it and its intervals hold none; else 0."""
    if fit.recorded is None or not assumes_scatter(fit):
        return 0.0
    each = [USUAL if part == "Ts" else USUAL_TAU for part in PARTS.get(name, ("Ts",))]
    return float(np.hypot.reduce(each) / np.sqrt(max(fit.recorded.engagements, 1)))


def of_whole_plant(fit: Fit, name: str) -> bool:
    """Whether a number of a fit is one of all levels."""
    part = fit.another_plant
    of_lags = part is not None and part.zeta is not None and name in names_of(part.plant)
    return of_lags or name in WHOLE_NUMBERS


def of_another_plant(fit: Fit) -> list[tuple[float, CurveLevel]]:
    """T_s of the levels of a plant that has no curves of τ1 and τ2, as one that rings."""
    part = fit.plant_
    if part is None or part.ci95 is None:
        return []
    rows = part.ci95.levels.get("Ts", ())
    return [(u, CurveLevel(u, part.at(u)["Ts"][0], ci95=LevelIntervals((low, high)))) for u, low, high in rows]


def run_scatter(fits: Iterable[Fit], name: str) -> float | None:
    """Standard deviation of ln θ from run to run, in the mean of the fits that know it."""
    known = [sd for fit in fits if (sd := _run_scatter(fit, name)) is not None]
    return float(np.sqrt(np.mean(np.square(known)))) if known else None


def _run_scatter(fit: Fit, name: str) -> float | None:
    if name in RESPONSES:
        runs = {row.level: row.runs for row in fit.responses}
        each = [one.sd_log**2 * runs[one.level] for one in values_of_fit(fit, name, "")]
        return float(np.sqrt(np.mean(each))) if each else None
    if (usual := unseen_scatter(fit, name)) > 0 and fit.recorded is not None:
        return float(usual * np.sqrt(max(fit.recorded.engagements, 1)))
    noise = fit.uncertainty.noise if fit.uncertainty is not None else None
    known = [sd for part in PARTS.get(name, ("tau1",)) if (sd := noise.scatter.get(part))] if noise is not None else []
    return float(np.hypot.reduce(known)) if known else None


def snapped(values: Sequence[SessionValue]) -> list[SessionValue]:
    """Levels that are nearly alike made the same."""
    levels = np.unique([one.level for one in values])
    group = np.cumsum(np.append(0, np.diff(np.log(levels)) > LEVELS_SAME)) if len(levels) else levels
    same = {float(u): median(levels[group == g]) for u, g in zip(levels, group, strict=True)}
    return [one if same[one.level] == one.level else replace(one, level=same[one.level]) for one in values]


def interpolated(values: Sequence[SessionValue], levels: Sequence[float]) -> list[SessionValue]:
    """Values of a curve at other levels than those at which it was shown, within these."""
    if len(values) < 2:
        return list(values)
    rows = np.array([(one.level, np.log(one.value), one.sd_log, one.dof) for one in values])
    u, *known = rows[np.argsort(rows[:, 0])].T
    at = [level for level in levels if u[0] <= level <= u[-1]]
    rows = np.array([np.interp(at, u, one) for one in known]).T
    return [
        SessionValue(values[0].session, level, float(np.exp(log)), float(sd), float(dof))
        for level, (log, sd, dof) in zip(at, rows, strict=True)
    ]


def logs_of(fit: Fit) -> tuple[Input, ...]:
    """The logs behind a fit, each once."""
    return tuple(Input(*one) for one in dict.fromkeys((one.path, one.sha256) for one in fit.data.sources))


def told_together(fits: Mapping[str, Fit]) -> list[Finding]:
    """What is to be known of fits that belong together: which must not be used.

    DataError where one is of other units, kind, drive or stand than the first, or has a log of another.
    """
    faults, (first, *others) = [], list(fits)
    for name in others:
        pairs = zip(_conditions(fits[first]).items(), _conditions(fits[name]).values(), strict=True)
        known = [(what, a, b) for (what, a), b in pairs if None not in (a, b)]
        if differ := [f"{what} {a or 'none'} and {b or 'none'}" for what, a, b in known if a != b]:
            faults.append(
                f"{name}: is not of the same rig as {first}: {'; '.join(differ)}; only what the rig does by itself may "
                "differ from session to session"
            )
    seen: dict[str, str] = {}
    for name, fit in fits.items():
        held = [(log.path, seen.setdefault(log.sha256, name)) for log in logs_of(fit) if log.sha256]
        if both := [(path, before) for path, before in held if before != name]:
            (path, before), more = both[0], f" (and {len(both) - 1} more)" if len(both) > 1 else ""
            faults.append(f"{name}: holds {path}{more}, which {before} holds too; a log is of one session")
    for name in others:
        size = _times(fits[first], fits[name])
        if first != RIG_NAME and not 1 / NO_RIG <= size <= NO_RIG:
            faults.append(
                f"{name}: its T_s is {size:.3g} times that of {first}, which no mounting makes of a rig: was one of "
                "them recorded in another unit? say it with «units» output=UNIT where it is fitted"
            )
    if faults:
        raise DataError(*faults)
    unusable = {name: fit.verdict.sentence for name, fit in fits.items() if not fit.verdict.usable}
    told = [finding("session-not-usable", name, why=why) for name, why in unusable.items()]
    return told + [finding("session-assumes-scatter", name) for name, fit in fits.items() if assumes_scatter(fit)]


def plant_moved(subject: str, one: Fit, other: Fit) -> list[Finding]:
    """Said where the kind, the dead time, the share of the fast part or the damping is not another session's, which no
    level tells."""
    if one.plant_ is None or other.plant_ is None:
        return []
    if (kinds := (one.plant_.kind, other.plant_.kind))[0] != kinds[1]:
        return [finding("kind-moved", subject, (), a=kinds[0], b=kinds[1])]
    tau1, found = float(one.plant.time_constants(one.plant.u_range[1])[0]), []
    for name, symbol, unit, least in (
        ("dead_time_s", "dead time", " s", LEAST_LATE * tau1), ("C", "C", "", LEAST_APART_C),
        ("zeta", "ζ", "", LEAST_APART_ZETA),
    ):  # fmt: skip
        (a, a_ends), (b, b_ends) = ((getattr(p, name), getattr(p.ci95, name, None)) for p in (one.plant_, other.plant_))
        if a is None or b is None:
            continue
        (a_low, a_high), (b_low, b_high) = a_ends or (a, a), b_ends or (b, b)
        if (a_low > b_high or b_low > a_high) and abs(a - b) > least:
            found.append(finding("plant-moved", subject, (), what=symbol, a=a, b=b, unit=unit))
    return found


def _times(first: Fit, fit: Fit) -> float:
    """By what factor T_s of a fit lies above that of another at the levels that both hold; 1 where there are none."""
    at, known = ([(row.level, row.Ts) for row in one.level_values if row.Ts and row.level > 0] for one in (first, fit))
    rows = [b / a for u, a in at for v, b in known if abs(np.log(v / u)) < LEVELS_SAME]
    return median(rows) if rows else 1.0


def _conditions(fit: Fit) -> dict[str, str | None]:
    """What has to be the same for all sessions; None of what is not known."""
    data, rig = fit.data, fit.data.apparatus
    said = {"kind": data.kind, "input unit": data.input_unit, "output unit": data.output_unit}
    rows = [(DRIVE.get(one.name, one.name), one.name) for one in fields(Apparatus) if one.name != "sample_rate_hz"]
    named: dict[str, set[str]] = {}
    for source in data.sources:
        for key, number in factors_of(source.run).items():
            named.setdefault(key, set()).add(number)
    in_names = {f"{what} ({key}= in the names)": ", ".join(sorted(named.get(key, ()))) for key, what in NAMED.items()}
    return {**said, **{what: None if rig is None else f"{getattr(rig, name):g}" for what, name in rows}, **in_names}


def table_values(frame: "pandas.DataFrame") -> list[SessionValue]:
    """The values of a plain table with the columns session, level, value, sd_log; DataError for one that is none."""
    missing = [name for name in PLAIN_COLUMNS if name not in frame.columns]
    if missing:
        raise DataError(f"the table has no column {missing[0]}; give {', '.join(PLAIN_COLUMNS)}, a value a row")
    cells = frame[list(PLAIN_COLUMNS)]
    numbers = cells.iloc[:, 1:].apply(pandas.to_numeric, errors="coerce").to_numpy(dtype=np.float64)
    fine = ((numbers >= 0) & (numbers < MANY)).all(axis=1) & (numbers[:, :2] > 0).all(axis=1)
    fine &= cells["session"].notna().to_numpy()
    if not fine.all():
        rule = "level and value have to be above 0 and sd_log 0 or above, as the model is one of logarithms"
        wrong = [(k + 1, ", ".join(map(str, cells.iloc[k]))) for k in np.flatnonzero(~fine)[:5]]
        raise DataError(*(f"row {k} of the table ({row}): {rule}; mend or drop it" for k, row in wrong))
    found = [SessionValue(str(session), *row) for session, row in zip(cells["session"], numbers.tolist(), strict=True)]
    first = dict[tuple[str, float], SessionValue]()
    for k, one in enumerate(found, 1):
        other = first.setdefault((one.session, one.level), one)
        if abs(np.log(one.value / other.value)) > IMPOSSIBLE * max(one.sd_log, other.sd_log, EXACT):
            raise DataError(
                f"row {k} of the table: session {one.session} at {one.level:g} has {one.value:g} and {other.value:g}, "
                f"each said to be known to {100 * one.sd_log:.2g} %; give the mean of the two, with an sd_log by how "
                "they scatter"
            )
    return found


def read_sessions(paths: Sequence[Path]) -> tuple[dict[str, Fit], list[SessionValue], list[Finding]]:
    """Files of fits by their names, or the values of one table; and what is to be told of the files."""
    if len(paths) == 1 and paths[0].suffix.lower() in (".csv", ".tsv", ".txt"):
        try:
            return {}, table_values(pandas.read_csv(paths[0], sep=None, engine="python", comment="#")), []
        except (DataError, ValueError) as fault:
            raise DataError(f"{paths[0]}: {str(fault).splitlines()[0]}") from None
    if twice := next((path for k, path in enumerate(paths) if path in paths[:k]), None):
        raise DataError(f"{twice}: is given twice; a session is one fit")
    stems, read = [path.stem for path in paths], [codec.read_as(path, Fit) for path in paths]
    names = stems if len(set(stems)) == len(stems) else list(map(str, paths))
    return dict(zip(names, (fit for fit, _ in read), strict=True)), [], [one for _, told in read for one in told]
