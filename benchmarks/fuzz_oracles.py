"""What a mutated file holds, read a second way: a reader that takes it must have the same numbers.

Only files whose meaning is beyond doubt are judged: plain text cells, and datasets of eaid, whose digest and checksums
leave no room for another value.
"""

import gzip
import io
import re
import zlib
from collections.abc import Callable
from typing import Any

import numpy as np

PLAIN = re.compile(rb"[+-]?[0-9]{1,15}(\.[0-9]{1,15})?")


def text(data: bytes, answer: Any) -> str:
    """Files of the header of eaid and plain cells alone: their numbers are what Python's float() says."""
    header, _, rest = data.partition(b"\n")
    if header != b"time_s,duty_pct,torque_nm" or not data.endswith(b"\n") or b"\r" in data:
        return ""
    rows = [line.split(b",") for line in rest[:-1].split(b"\n")]
    if any(len(row) != 3 or not all(PLAIN.fullmatch(cell) for cell in row) for row in rows):
        return ""
    wanted = np.array([[float(cell) for cell in row] for row in rows]).T
    ((table, cells),) = answer
    if table.columns != ("time_s", "duty_pct", "torque_nm") or cells.bad:
        return f"plain cells not taken as such: {table.columns}, {cells.bad[:3]}"
    same = all(np.array_equal(a, b) for a, b in zip(cells.values, wanted, strict=True))
    return "" if same else "plain cells read as other numbers"


def packed(data: bytes, answer: Any) -> str:
    """As `text`, of what a gzip holds."""
    try:
        return text(gzip.decompress(data), answer)
    except (OSError, EOFError, zlib.error) as fault:
        return f"a gzip is taken that gzip refuses: {fault}"


def dataset(data: bytes, answer: Any) -> str:
    """Runs of a mutated data.h5 with a digest: those that were written, bit for bit."""
    import h5py

    from benchmarks.fuzz_seeds import dataset_runs

    runs, _ = answer
    if not runs:
        return ""
    with h5py.File(io.BytesIO(data), "r") as file:
        if "digest" not in file.attrs:
            return ""  # the user's own, or no longer sealed
    written = {run.name: run for run in dataset_runs()}
    for run in runs:
        if run.name not in written:
            return f"a run {run.name} that nobody wrote"
        for name in ("time_s", "input", "output", "level", "repeat", "step_s", "baseline"):
            if not np.array_equal(getattr(run, name), getattr(written[run.name], name)):
                return f"{name} of {run.name} differs from what was written"
    return ""


ORACLES: dict[str, Callable[[bytes, Any], str]] = {"text": text, "gzip": packed, "dataset": dataset}
