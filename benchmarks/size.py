"""`python -m benchmarks.size [csv] [day] [runs] [--share 0.1] [--keep FOLDER]`: large logs, their time and peak memory.

`csv`: one log of 1 GB; `day`: 24 h at 1 kHz in one log, 86.4 million rows; `runs`: 1,000 logs in one call: ingested.
`levels`: 300 levels; `many`: 5,000 runs; `long`: 2.8 h at 10 kHz: fitted and reported. Each command is a process of its
own, whose peak resident memory is read from the kernel. `--share` makes them smaller.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

CYCLE_S, IDLE_S, HOLD_S = 72.0, 10.0, 50.0
LEVELS = tuple(range(10, 101, 10))


def piece(start: int, stop: int, rate_hz: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Samples start … stop − 1 of an endless log: 10 s idle, 50 s at a level, 12 s idle, then the next level."""
    index = np.arange(start, stop)
    t = index / rate_hz
    phase = t % CYCLE_S
    level = np.asarray(LEVELS)[(t // CYCLE_S).astype(int) % len(LEVELS)]
    on = (phase >= IDLE_S) & (phase < IDLE_S + HOLD_S)
    duty = np.where(on, level, 0.0)
    since = np.clip(phase - IDLE_S, 0, HOLD_S)
    rise = 0.04 * level * (1 - 0.85 * np.exp(-since / 0.5) - 0.15 * np.exp(-since / 5.0))
    fall = np.where(phase >= IDLE_S + HOLD_S, np.exp(-(phase - IDLE_S - HOLD_S) / 0.4), 1.0)
    torque = np.where(phase >= IDLE_S, rise * fall, 0.0) + 0.01 * np.sin(index * 12.9898) * np.cos(index * 4.1414)
    return t, duty, torque


def write(path: Path, rows: int, digits: int | None, rate_hz: float = 1000.0) -> None:
    """A CSV of so many rows, piece by piece."""
    import pyarrow
    from pyarrow import csv

    with path.open("wb") as file:
        for start in range(0, rows, 1_000_000):
            t, duty, torque = piece(start, min(rows, start + 1_000_000), rate_hz)
            if digits is not None:
                torque = np.round(torque, digits)
            table = pyarrow.table({"time_s": t, "duty_pct": duty, "torque_nm": torque})
            csv.write_csv(table, file, csv.WriteOptions(include_header=start == 0))


def eaid(*words: str) -> tuple[float, float, str]:
    """Seconds by the clock, peak resident memory [MB] and last line of stderr of one command."""
    program = (
        "import resource, sys; from eaid.cli.main import run; code = run(sys.argv[1:]); "
        "used = [resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]; "
        "print('peak', max(used), file=sys.stderr); sys.exit(code)"
    )
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", program, *words, "--force"],
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False,
    )  # fmt: skip
    took = time.perf_counter() - start
    lines = done.stderr.strip().splitlines()
    said = [line for line in lines if not line.startswith("peak")]
    peak = next(int(line.split()[1]) for line in reversed(lines) if line.startswith("peak")) / 1024
    return took, peak, f"exit {done.returncode}: {said[-1][:200] if said else ''}"


def results(name: str, share: float, folder: Path) -> Iterator[str]:
    """Fit and report of a synthetic dataset with many levels, many runs, or many samples."""
    levels, repeats, rate = {"levels": (300, 1, 100), "many": (10, 250, 50), "long": (10, 5, 10_000)}[name]
    count = max(3, round(levels * share)) if name == "levels" else levels
    each = max(1, round(repeats * share)) if name == "many" else repeats
    parts = max(1, round(5 * share)) if name == "long" else 1  # synth makes 20 million samples at most
    data, fit = [str(folder / f"{name}{k}.h5") for k in range(parts)], str(folder / f"{name}.json")
    duties = ",".join(f"{duty:.6g}" for duty in np.linspace(10, 100, count))
    made = ("--levels", duties, "--repeats", str(each), "--rate-hz", str(rate), "--noise-nm", "0.01")
    for k, path in enumerate(data):
        eaid("synth", "-q", *made, "--seed", str(k), "-o", path)
    size = sum(Path(path).stat().st_size for path in data) / 1e6
    for words in (("fit", "-q", *data, "-o", fit), ("report", "-q", fit, *data, "-o", str(folder / name))):
        took, peak, said = eaid(*words)
        what = f"{words[0]} of {count} levels × {each * parts} at {rate:,} Hz, {size:,.0f} MB"
        yield f"{what}: {took:.1f} s, peak {peak:,.0f} MB; {said}"


def sizes(which: list[str], share: float, folder: Path) -> Iterator[str]:
    for name in which:
        if name in ("levels", "many", "long"):
            yield from results(name, share, folder)
            continue
        if name == "runs":
            logs = folder / "runs"
            logs.mkdir(exist_ok=True)
            count = round(1000 * share)
            for i in range(count):
                begin = i % len(LEVELS) * 72_000
                t, duty, torque = piece(begin, begin + 32_000, 1000.0)
                rows = np.column_stack([t - t[0], duty, np.round(torque, 6)])
                path = logs / f"run{i:04}.csv"
                if not path.exists():
                    np.savetxt(path, rows, "%.9g", ",", header="time_s,duty_pct,torque_nm", comments="")
            what, size, given = f"{count} logs of 32 s at 1 kHz", sum(p.stat().st_size for p in logs.iterdir()), logs
        else:
            given = folder / f"{name}.csv"
            rows = round((86_400_000 if name == "day" else 30_500_000) * share)
            if not given.exists():
                write(given, rows, 5 if name == "day" else None)
            size, what = given.stat().st_size, f"{rows:,} rows in one log"
        took, peak, said = eaid("ingest", str(given), "-o", str(folder / "data.h5"))
        yield f"{what}, {size / 1e6:,.0f} MB: {took:.1f} s ({size / 1e6 / took:.0f} MB/s), peak {peak:,.0f} MB; {said}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("which", nargs="*", default=["csv", "day", "runs"])
    parser.add_argument("--share", type=float, default=1.0)
    parser.add_argument("--keep", type=Path)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as own:
        folder = given.keep or Path(own)
        folder.mkdir(exist_ok=True)
        for line in sizes(given.which, given.share, folder):
            print(line, flush=True)


if __name__ == "__main__":
    main()
