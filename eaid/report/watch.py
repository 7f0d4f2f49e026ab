"""Files that are looked at again and again: a signal whenever one of them has changed."""

import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TypeAlias

State: TypeAlias = tuple[tuple[int, int, int] | None, ...]


def changes(paths: Sequence[Path], every_s: float = 0.25) -> Iterator[None]:
    """Yields once after each change of any of the files, when all are there and two looks in a row agree.

    Changes count from this call on, not from when the first is asked for.
    """
    return _after(_state(paths), paths, every_s)


def _after(seen: State, paths: Sequence[Path], every_s: float) -> Iterator[None]:
    before = seen
    while True:
        time.sleep(every_s)
        now = _state(paths)
        if now == before != seen and None not in now:
            seen = now
            yield
        before = now


def _state(paths: Sequence[Path]) -> State:
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
