"""A duty that changes as a file says: CSV `time_s,duty_pct`, a row held until the next, the last one ends the log."""

import csv
import math
from pathlib import Path

from eaid.errors import DataError
from eaid.synth.logs import Input

HEADER = ["time_s", "duty_pct"]


def read_input(path: Path) -> tuple[Input, float]:
    """The changes of the duty (from when [s], duty [%]) and the length of the log [s]."""
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise DataError(f"{path}: is no text; give a CSV time_s,duty_pct") from None
    rows = [(number, row) for number, row in enumerate(csv.reader(text.splitlines()), 1) if row and row[0][:1] != "#"]
    if not rows or [cell.strip() for cell in rows[0][1]] != HEADER:
        raise DataError(f"{path}: its header is not time_s,duty_pct; name these two columns")
    changes: list[tuple[float, float]] = []
    faults = []
    for number, row in rows[1:]:
        try:
            time_s, duty_pct = map(float, row)
        except ValueError:
            faults.append(f"{path}: row {number} holds {','.join(row)!r}, not two numbers; mend it")
            continue
        if not (math.isfinite(time_s) and 0 <= duty_pct <= 100):
            faults.append(
                f"{path}: row {number} holds a duty outside 0 to 100 %, or a time that is not finite; mend it"
            )
        elif changes and time_s <= changes[-1][0]:
            faults.append(f"{path}: time falls or stands still at row {number} ({time_s:g} s); sort the rows")
        else:
            changes.append((time_s, duty_pct))
    if faults:
        raise DataError(*faults[:20])
    if len(changes) < 2:
        raise DataError(f"{path}: holds fewer than two rows; the last row ends the log")
    start = changes[0][0]
    return [(time_s - start, duty_pct) for time_s, duty_pct in changes[:-1]], changes[-1][0] - start
