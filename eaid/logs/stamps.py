"""Wall-clock stamps (`2024-10-29 16:18:17.123`, `16:18:17,5`) → seconds; an offset from UTC counts."""

import re
from collections.abc import Sequence
from datetime import datetime

import numpy as np

from eaid.arrays import Array

_CLOCK = re.compile(
    r"(?:(\S+?)[T ]+)?(\d{1,2}):(\d{2})(?::(\d{2})(?:[.,](\d+))?)?\s*(AM|PM)?(Z|([+-])(\d{2}):?(\d{2}))?$"
)
_DATES = ("%Y-%m-%d", "%Y/%m/%d", "%Y.%m.%d", "%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y")


def _day(text: str) -> int | None:
    for form in _DATES:
        try:
            return datetime.strptime(text, form).toordinal()
        except ValueError:
            continue
    return None


def _is_clock(found: re.Match[str]) -> bool:
    return int(found.group(2)) < 24 and int(found.group(3)) < 60 and int(found.group(4) or 0) < 61


def seconds_of(texts: Sequence[str]) -> tuple[Array, list[int]]:
    """Seconds since the whole second of the first stamp, shape (n,), and the places of those that cannot be read (NaN).

    A clock without a date that falls by more than half a day has passed midnight.
    """
    seconds = np.full(len(texts), np.nan)
    wrong = []
    days: dict[str, int | None] = {"": 0}
    first: float | None = None
    added, last = 0, 0.0
    for i, text in enumerate(texts):
        found = _CLOCK.match(text.strip().strip('"'))
        date = (found.group(1) or "") if found else ""
        if date not in days:
            days[date] = _day(date)
        day = days[date]
        if not found or day is None or not _is_clock(found):
            wrong.append(i)
            continue
        hour = int(found.group(2))
        if found.group(6):
            hour = hour % 12 + 12 * (found.group(6) == "PM")
        clock = 3600 * hour + 60 * int(found.group(3)) + int(found.group(4) or 0)
        if not date and clock - last < -43200:
            added += 1
        last = clock
        if found.group(8):  # a stamp of 14:00+02:00 is one of 12:00 UTC
            clock -= int(f"{found.group(8)}1") * (3600 * int(found.group(9)) + 60 * int(found.group(10)))
        # whole seconds and their fraction apart: a day number times 86,400 would cost the last digits
        whole = (day + added) * 86400 + clock
        first = whole if first is None else first
        seconds[i] = (whole - first) + float(f"0.{found.group(5) or 0}")
    return seconds, wrong
