"""One table → one run: columns by name, rows checked, time from its start, units turned into those of eaid."""

import contextlib
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array, read_only
from eaid.errors import DataError
from eaid.findings import Finding, finding
from eaid.logs.clocks import clock_of, contradicting, contradiction, other_clocks
from eaid.logs.columns import FEWEST_IN_COLUMN, Roles, chosen_table, default_unit, leaves_rest, rises, the_input
from eaid.logs.run import INPUT_UNITS, Beside, Run
from eaid.logs.table import Cells, Table, plain
from eaid.logs.units import UNKNOWN, Scale, numbers_samples, scale_of, seconds_since_start, split_name, time_unit
from eaid.options import ReadOptions

# Beyond it, or all below its inverse, numbers are none that a sensor gives, and their squares may be none at all
LARGEST_READING = 1e100
LARGEST_NM = 1000.0  # Torque beyond any clutch that a bench holds [N·m]: a column of counts, or of another unit
SHOWN_FAULTS = 5  # Bad rows of a kind up to which each is told; of more, the first and a count


def checked(
    source: str,
    columns: Mapping[str, NDArray[Any]],
    unread: Sequence[tuple[int, str, str]],
    row_of: Callable[[int], int],
    word: str,
    repair: bool,
    time_factor: float = 1.0,
) -> NDArray[np.intp] | None:
    """Samples to keep (None: all); raises DataError where rows are bad, all its faults at once.

    `columns` by their label, the first of them the time. `unread` lists cells that could not be read: (sample, column
    label or empty for the whole row, what stands there).
    """
    time = next(iter(columns.values()))
    count = len(time)
    if count == 0:
        raise DataError(f"{source}: has a header but no rows; record the log again")
    if not unread and all(np.isfinite(values).all() for values in columns.values()) and (np.diff(time) > 0).all():
        return None
    texts = {(sample, label): text for sample, label, text in unread}
    for label, values in columns.items():
        gone = int(np.isnan(values).sum())
        words = [text for (_, column), text in texts.items() if column == label and text]
        if gone == count and words:
            raise DataError(
                f"{source}: column {label} holds no number in any row, but words such as {words[0]!r}; write what they "
                f"stand for in numbers, or name another column with «columns»"
            )
        if count >= FEWEST_IN_COLUMN and 0.2 * count < gone < count:
            raise DataError(
                f"{source}: column {label} holds a number in {count - gone} of {count} rows only; save the rows in "
                f"which it was sampled, or all columns at one rate"
            )
    torn = {sample: text for sample, label, text in unread if not label}
    faults_of = {sample: [f"{word} {row_of(sample)} has {text} cells, unlike the others"]
                 for sample, text in torn.items()}  # fmt: skip
    for label, values in columns.items():
        for sample in sorted({*np.flatnonzero(~np.isfinite(values)).tolist()} - torn.keys()):
            found = texts.get((sample, label))
            what = "is infinite" if np.isinf(values[sample]) else "is empty or not a number"
            if found is not None:
                number = re.fullmatch(r"[+-]?(nan|inf|[\d.]+e\+?\d{3,})", found, re.IGNORECASE)
                what = f"holds {found!r}, which is {'not finite' if number else 'no number'}" if found else "is empty"
            faults_of.setdefault(sample, []).append(f"{word} {row_of(sample)}, column {label}, {what}")
    bad = np.isin(np.arange(count), list(faults_of))
    fine = np.flatnonzero(~bad)
    rising = time[fine]
    # a row is bad where its time is not above all times before it: dropping those leaves a rising time
    highest = np.maximum.accumulate(rising)
    late = np.flatnonzero(rising[1:] <= highest[:-1]) + 1
    repeated = int(np.count_nonzero(rising[1:] == rising[:-1]))
    if repeated > 0.2 * count:  # the stamps have too few digits
        raise DataError(
            f"{source}: {repeated} of {count} rows repeat the time of the row before, from {word} "
            f"{row_of(int(fine[late[0]]))} on: its stamps have too few digits, or rows were written twice; save each "
            f"row once, with all digits, or leave the time out and give the sample rate with «rate_hz»"
        )
    jumps = np.flatnonzero(np.diff(rising) <= 0) + 1
    set_back = len(late) > 5 * len(jumps)  # the clock was set back, and went on
    cells, falls = [fault for sample in sorted(faults_of) for fault in faults_of[sample]], list[str]()
    for k in (jumps if set_back else late).tolist():
        now, before = float(rising[k]) * time_factor, float(highest[k - 1]) * time_factor
        how = "is repeated" if rising[k] == highest[k - 1] else "falls"
        falls.append(f"time {how} at {word} {row_of(int(fine[k]))} ({now:.12g} s after {before:.12g} s)")
    bad[fine[late]] = True
    dropped = int(bad.sum())
    few = dropped <= 0.01 * count
    drop = ", or drop such rows with «repair»" if few else ""
    faults = [
        *_listed(source, cells, f"mend the cell{drop}"),
        *_listed(source, falls, "split the log where its clock was set back" if set_back else f"sort the rows{drop}"),
    ]
    if not repair:
        raise DataError(*faults)
    if not few:
        raise DataError(
            f"{source}: {dropped} of {count} rows are bad, more than «repair» drops (1 % of a log); record it again",
            *faults,
        )
    return np.flatnonzero(~bad)


def _listed(source: str, faults: Sequence[str], remedy: str) -> list[str]:
    if len(faults) > SHOWN_FAULTS:
        faults = [f"{faults[0]}, and {len(faults) - 1} more such rows"]
    return [f"{source}: {what}; {remedy}" for what in faults]


def _loaded(source: str, table: Table, wanted: Sequence[int | None]) -> tuple[Cells, dict[int, NDArray[Any]]]:
    """Columns by their number; DataError where one is too large or too small for a sensor."""
    columns = list(dict.fromkeys(one for one in wanted if one is not None))
    cells, sane = table.load(columns), dict[int, NDArray[Any]]()
    for column, values in zip(columns, cells.values, strict=True):
        if values.dtype.kind in "ub":  # signed, so that differences may be below zero
            too_large = values.dtype == np.uint64 and len(values) and values.max() > np.iinfo(np.int64).max
            values = values.astype(np.float64 if too_large else np.int64)
        if values.dtype.kind != "i":
            values = np.asarray(values, dtype=np.float64)
            size = np.abs(values[np.isfinite(values)]).max(initial=0)
            if size != 0 and not 1 / LARGEST_READING <= size <= LARGEST_READING:
                raise DataError(f"{source}: column {table.label(column)} goes to {size:g}, as no sensor does; mend it")
        sane[column] = values
    return cells, sane


_BEFORE = re.compile(r"\d[.,ep_-]?$", re.IGNORECASE)
# What stands beside a number that may be a part of a longer one: 2-5V, 2p5V, 1e2V, 2_5V, 1,000V
_AFTER = re.compile(r"[.,]?\d|[ep-][+-]?\d|_\d{1,3}(?!\d)", re.IGNORECASE)
_DATED = re.compile(r"(\d{4}([-_.]?)\d\d\2\d\d|\d\d[-_.]\d\d[-_.]\d{4})[-_]$")


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


# Units of inputs as they stand in names beside a level: V=100, 60pct; lower-case letters stand for much else
_LEVELS = "V|kV|mV|mA|A|N|kN|bar|kPa|MPa|rpm|RPM|pct|%"


def unit_beside(pattern: str) -> str:
    """The unit that a name pattern holds beside its level; empty where it holds none."""
    found = re.search(rf"(?:^|[^A-Za-z])({_LEVELS})=?\{{level\}}|\{{level\}}({_LEVELS})(?![A-Za-z])", pattern)
    return found[1] or found[2] if found else ""


_COUNTS_RUNS = re.compile(r"(?<![A-Za-z])(r|n|no|nr|run|rep|repeat|trial|test|take)[_-]?$", re.IGNORECASE)


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


def run_of(
    name: str, source: str, sha256: str, tables: Sequence[Table], options: ReadOptions, file: str = ""
) -> Run:  # fmt: skip
    """The run behind the tables of one log; the name pattern is looked for in `file`, or in the name."""
    name = plain(name)
    table, roles = chosen_table(source, tables, options)
    clock, units = roles.time, options.units
    if clock is not None and options.rate_hz is not None:
        if not numbers_samples(table.columns[clock]):
            raise DataError(
                f"{source}: has a time column, {table.label(clock)}, so «rate_hz» does nothing; leave it out"
            )
        clock = None
    level, repeat = level_and_repeat(source, options.name_pattern, file or name)
    kind, which = the_input(source, roles, lambda one: _loaded(source, table, [one])[1][one])
    if which is None and options.name_pattern is not None and level is None:
        raise DataError(f"{source}: its name does not match «name_pattern»; rename it or mend the pattern")

    by_user, by_column = None, None
    if clock is not None:
        by_user, by_column = time_unit(source, units.get("time"), table, clock)
    elif options.rate_hz is not None:
        by_user = 1.0 / options.rate_hz
    factor = by_user or by_column or 1.0
    cells, columns = _loaded(source, table, [roles.output, clock, roles.reference, roles.position, which])
    raw_time = np.arange(len(columns[roles.output])) if clock is None else columns[clock]
    if clock is not None and clock not in table.stamped:
        own = clock_of(table.label(clock), raw_time, by_column or 1.0)
        other = contradicting(own, other_clocks(source, table, roles.taken))
        if other is not None and by_user is None:
            raise contradiction(source, own, other)
        by_column = by_column if other is None else None  # its header is wrong, or the user knows better
    used = [column for column in (which, roles.output, roles.position) if column is not None]
    label = "time" if clock is None else table.label(clock)
    by_label = {label: raw_time} | {table.label(i): columns[i] for i in used}
    bad = sorted((one.row, one.column, one.text) for one in cells.bad if one.column in {-1, clock, *used})
    unread = [(row, "" if column < 0 else table.label(column), text) for row, column, text in bad]
    keep = checked(source, by_label, unread, cells.row, "row", options.repair, factor)
    kept_time = raw_time if keep is None else raw_time[keep]
    kept = {column: values if keep is None else values[keep] for column, values in columns.items()}
    time_s, start_s, of_time = seconds_since_start(source, label, kept_time, by_user, by_column)
    named = table.columns[roles.output]
    into = scale_of(source, "output", units.get("output"), table, roles.output, default_unit(named))
    output = into.of(kept[roles.output])
    if which is not None and kind is not None:
        plain_input = default_unit(table.columns[which], kind)
        scale = scale_of(source, "input", units.get("input"), table, which, plain_input)
        input_ = scale.of(kept[which])
    else:
        scale = Scale(INPUT_UNITS[kind], 1.0) if kind else _of_names(source, options)
        input_ = np.broadcast_to(np.float64(np.nan), len(kept_time))  # takes no memory
    told = [*roles.findings, *of_time, *_asked_once([*scale.findings, *into.findings])]
    if keep is not None:
        total = len(raw_time)
        told.append(finding("rows-dropped", source, dropped=total - len(keep), count=total))
    largest = float(np.abs(output).max())
    if into.unit == "N·m" and "output" not in units and largest > LARGEST_NM:
        told.append(finding("torque-too-large", source, largest=largest))
    if level is not None and which is not None and not (np.abs(np.abs(input_) - abs(level)) <= 0.02 * abs(level)).any():
        most = float(input_[np.abs(input_).argmax()])
        told.append(finding("level-contradicted", source, level=level, found=most, unit=scale.unit))
    of_role = {"time": clock, "input": which, "output": roles.output, "reference": roles.reference,
               "position": roles.position}  # fmt: skip
    taken = {role: column for role, column in of_role.items() if column is not None}
    others = [table.label(column) for column in range(len(table.columns)) if column not in taken.values()]
    position_unit = units.get("position", "")  # as it is called: nothing is turned into it
    if roles.position is not None and not position_unit:
        position_unit = table.unit(roles.position) or split_name(table.columns[roles.position])[1]
    beside = partial(_beside, table, roles, keep)
    reference, position = (None if one is None else read_only(kept[one]) for one in (roles.reference, roles.position))
    return Run(
        name, time_s, read_only(input_), output, scale.unit, into.unit, source, sha256,
        level=level if which is None else None, repeat=repeat, start_s=start_s, synthetic=table.synthetic,
        step_s=_on_clock(options.step_at, time_s, start_s), until_s=_on_clock(options.until, time_s, start_s),
        reference_nm=reference, position=position, position_unit=position_unit, kind=options.kind or kind,
        findings=tuple(msgspec.structs.replace(one, subject=name) for one in told),
        taken=tuple((role, table.label(column)) for role, column in taken.items()), left=(*others, *table.dropped),
        moves=_moves(beside(), time_s) if which is None else (), others=beside,
    )  # fmt: skip


def _of_names(source: str, options: ReadOptions) -> Scale:
    """The unit of levels that names tell, which hold none but beside the level."""
    if unit := options.units.get("input"):
        return Scale(unit, 1.0)
    likely = unit_beside(options.name_pattern or "") or "UNIT"
    asked = finding("unit-unknown", source, column="the levels of names", ask=f"input={likely}")
    return Scale(UNKNOWN, 1.0, (asked,) if options.name_pattern else ())


def _asked_once(findings: Sequence[Finding]) -> list[Finding]:
    """Unknown units of one log as one question."""
    open_ = [one for one in findings if one.code == "unit-unknown"]
    if len(open_) < 2:
        return list(findings)
    column, ask = (sep.join(str(one.values[key]) for one in open_) for key, sep in (("column", " and "), ("ask", ",")))
    one = finding("unit-unknown", open_[0].subject, column=column, ask=ask)
    return [one, *(other for other in findings if other not in open_)]


MOST_OTHERS = 8  # Columns that are not read up to which they are looked at


def _beside(table: Table, roles: Roles, keep: NDArray[np.intp] | None) -> Beside:
    """The few columns that are not read, where they are numbers that move and no clock."""
    others = [column for column in range(len(table.columns)) if column not in roles.taken]
    cells: tuple[NDArray[Any], ...] = ()
    if 0 < len(others) <= MOST_OTHERS:
        with contextlib.suppress(DataError, OSError):  # what is bad in them is no fault of the log
            cells = table.load(others).values
    found = []
    for column, values in zip(others, cells, strict=False):
        values = values if keep is None else values[keep]
        if not rises(values) and np.isfinite(values).all() and np.ptp(values):
            found.append((table.label(column), read_only(values.astype(np.float64))))
    return tuple(found)


def _moves(beside: Beside, time_s: Array) -> tuple[tuple[str, float], ...]:
    """Which of the other columns leave their rest, and when."""
    instants = ((label, leaves_rest(values)) for label, values in beside)
    return tuple((label, float(time_s[at])) for label, at in instants if at is not None)


def _on_clock(instant_s: float | None, time_s: Array, start_s: float) -> float | None:
    """An instant of the log's clock on `time_s`; one outside the log that lies inside since its start is meant so."""
    if instant_s is None or not len(time_s):
        return instant_s
    since = instant_s - start_s
    outside = not time_s[0] <= since <= time_s[-1]
    return instant_s if outside and time_s[0] <= instant_s <= time_s[-1] else since
