"""Reads an MDF file with asammdf, in a process of its own: `python -m eaid.logs.mdf_apart FILE [GROUP]`.

The compiled part of asammdf writes outside its memory on some damaged files; that ends this process and no other. On
stdout comes an NPZ: without GROUP its `channels` (JSON: group, channel, name, unit, group's name, formula or not), with
GROUP the times and the values of every channel of numbers in it. Exit code 3, with a sentence on stdout, is a refusal.

asammdf unpacks a block to whatever is in it, and makes room for whatever it says. Where the system can bound memory
(Linux), the process gets `FLOOR` and what the file and the numbers asked for may take; more is a refusal. It goes round
for ever where blocks point in a circle: so its processor time is bounded too.
"""

import io
import json
import logging
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

NUMBERS = {3: (*range(4), *range(9, 17)), 4: tuple(range(6))}
"""Data types that are integers and floats, either byte order, by major version."""
FORMULA = {3: 10, 4: 3}
"""Conversion type of a formula, by major version."""
MOST_RATIO = 200
"""A group that unpacks to more than this many times the size of its file is a bomb (recorded logs: about 10)."""
FLOOR = 64 << 20
"""Memory for opening any file [bytes]."""
SLOWEST_S = 20.0
"""Processor time for any file; a second for every megabyte comes on top [s]."""


class RefusalError(Exception):
    """What is wrong, without the file's name."""


def contents(path: Path, group: int | None) -> dict[str, Any]:
    """Arrays of the NPZ; raises RefusalError, or whatever asammdf stumbles over."""
    import asammdf

    logging.disable(logging.CRITICAL)
    size = path.stat().st_size
    # as open bytes, since by its name a file would be unpacked, copied or cleared away
    limits = in_time(SLOWEST_S + size / 1e6), at_most(FLOOR + 4 * size)
    with path.open("rb") as raw, limits[0], limits[1] as more, asammdf.MDF(raw) as file:
        version = 4 if str(file.version) >= "4" else 3
        channels = _channels(file, version, size)
        if group is None:
            return {"channels": np.array(json.dumps(channels))}
        more(4 * _claimed(file.groups[group]) + 32 * sum(g == group for g, *_ in channels) * _count(file.groups[group]))
        found: dict[str, Any] = {}
        for g, c, _, _, _, formula in channels:
            if g != group or formula:
                continue
            one = file.get(group=g, index=c, raw=False)
            if one.samples.dtype.kind not in "fiub" or one.samples.ndim != 1:
                continue  # a conversion to words, or a table
            values = np.asarray(one.samples, dtype=np.float64)
            if one.invalidation_bits is not None:
                values = np.where(np.asarray(one.invalidation_bits), np.nan, values)
            found["times"] = np.asarray(one.timestamps, dtype=np.float64)
            found[str(c)] = values
        return found


@contextmanager
def in_time(most_s: float) -> Iterator[None]:
    """Bound the processor time of the block [s]."""

    def over(*_: Any) -> None:
        raise RefusalError(f"takes more than {most_s:.0f} s to read, as a damaged file does; copy or save it again")

    if not hasattr(signal, "setitimer"):  # Windows
        yield
        return
    before = signal.signal(signal.SIGPROF, over)
    signal.setitimer(signal.ITIMER_PROF, most_s, 1.0)  # again and again, since asammdf swallows what it did not expect
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


@contextmanager
def at_most(extra: int) -> Iterator[Callable[[int], None]]:
    """Bound what may be allocated in the block beyond what is held now [bytes]; yields a function that grants more."""
    try:
        import resource

        words = Path("/proc/self/status").read_text(encoding="ascii", errors="replace").partition("VmData:")[2].split()
        held = int(words[0]) << 10
    except (ImportError, OSError, IndexError):
        yield lambda _: None
        return
    before, hard = resource.getrlimit(resource.RLIMIT_DATA)

    def bound(granted: int) -> None:
        most = held + extra + granted
        resource.setrlimit(resource.RLIMIT_DATA, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))

    bound(0)
    try:
        yield bound
    except MemoryError:
        raise RefusalError("takes far more memory to unpack than its size and its channels account for") from None
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (before, hard))


def _count(group: Any) -> int:
    return max(int(group.channel_group.cycles_nr), 1)


def _claimed(group: Any) -> int:
    """Bytes of the records of a group."""
    spare = int(getattr(group.channel_group, "invalidation_bytes_nr", 0))
    return _count(group) * max(8, int(group.channel_group.samples_byte_nr) + spare)


def _channels(file: Any, version: int, size: int) -> list[tuple[int, int, str, str, str, bool]]:
    found = []
    for g, group in enumerate(file.groups):
        claimed = _claimed(group)
        if claimed > max(MOST_RATIO * size, 1 << 24):
            raise RefusalError(f"group {g + 1} claims {claimed:.3g} bytes in a file of {size:,} bytes; no log does")
        master = file.masters_db.get(g)
        name = str(getattr(group.channel_group, "acq_name", "") or f"group {g + 1}")
        if master is None or not group.channel_group.cycles_nr:
            continue
        for c, channel in enumerate(group.channels):
            if c != master and channel.data_type in NUMBERS[version]:
                formula = any(_is_formula(one, version) for one in (channel, group.channels[master]))
                found.append((g, c, str(channel.name), _unit(channel), name, formula))
    return found


def _is_formula(channel: Any, version: int) -> bool:
    return channel.conversion is not None and channel.conversion.conversion_type == FORMULA[version]


def _unit(channel: Any) -> str:
    said = channel.unit or (getattr(channel.conversion, "unit", "") if channel.conversion is not None else "")
    return (said.decode("latin-1") if isinstance(said, bytes) else str(said or "")).strip("\0 ")


def main() -> int:
    """Answer one question on stdout."""
    path, group = Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else None
    try:
        arrays = contents(path, group)
    except RefusalError as refusal:
        print(refusal)
        return 3
    except Exception as fault:  # asammdf has no common type for what it stumbles over
        reason = " ".join(str(fault).split())[:120].rstrip(".") or type(fault).__name__
        print(f"is a damaged MDF file ({reason}); copy or save it again")
        return 3
    answer = io.BytesIO()
    np.savez(answer, **arrays)
    sys.stdout.buffer.write(answer.getvalue())
    return 0


if __name__ == "__main__":
    sys.exit(main())
