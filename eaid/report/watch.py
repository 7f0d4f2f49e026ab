"""Files that are looked at again and again: a signal whenever one of them has changed."""

import time
from collections.abc import Iterator, Sequence
from pathlib import Path


def changes(paths: Sequence[Path], every_s: float = 0.5) -> Iterator[None]:
    """Yield once after each change of any of the files, when all of them are there and have come to rest."""
    seen = _state(paths)
    while True:
        time.sleep(every_s)
        now = _state(paths)
        if now == seen:
            continue
        while (later := _state(paths)) != now or None in later:
            now = later
            time.sleep(every_s)
        seen = now
        yield


def _state(paths: Sequence[Path]) -> tuple[tuple[int, int, int] | None, ...]:
    """Time, size and place of each file; None for one that is not there."""
    found: list[tuple[int, int, int] | None] = []
    for path in paths:
        try:
            told = path.stat()
        except OSError:
            found.append(None)
        else:
            found.append((told.st_mtime_ns, told.st_size, told.st_ino))
    return tuple(found)
