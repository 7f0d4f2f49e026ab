"""What a benchmark row is, how times are taken (medians of paired runs), and how the table is printed."""

import os
import platform
import statistics
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path


def asked(words: Sequence[str], count: int, known: Sequence[str]) -> tuple[int, Sequence[str]]:
    """How many sets of which rows a benchmark was asked for, as `30 base`; all rows by itself, ends where one is
    unknown."""
    sets, names = (words[0], words[1:]) if words and words[0] not in known else (str(count), words)
    if unknown := [name for name in ([] if sets.isdigit() else [sets]) + list(names) if name not in known]:
        raise SystemExit(f"{', '.join(unknown)}: no such row; give a number and names of {', '.join(known)}")
    return int(sets), names or known


@dataclass(frozen=True)
class Row:
    """One comparison: both times from the same run of the benchmark, the claimed ratio, and what was reached."""

    what: str
    ours: str
    ours_s: float
    other: str
    other_s: float
    bar: str
    """The bar in words, e.g. "≥ 1000 × faster" or "≤ 1.5 × the time"."""
    met: bool
    accuracy: str = ""

    @property
    def ratio(self) -> str:
        """Ours against the other, the larger number first."""
        if self.ours_s <= self.other_s:
            return f"{_figures(self.other_s / self.ours_s)} × faster"
        return f"{_figures(self.ours_s / self.other_s)} × the time"


def _figures(ratio: float) -> str:
    """Three figures, without an exponent."""
    return f"{float(f'{ratio:.3g}'):,.0f}" if ratio >= 1000 else f"{ratio:.3g}"


def paired_medians(
    ours: Callable[[], object],
    other: Callable[[], object],
    runs: int = 7,
    clock: Callable[[], float] = time.perf_counter,
) -> tuple[float, float]:
    """Median times [s] of two calls taken in turn, A B A B …, after one warm-up of each."""
    ours(), other()
    times: tuple[list[float], list[float]] = ([], [])
    for _ in range(runs):
        for call, kept in zip((ours, other), times, strict=True):
            start = clock()
            call()
            kept.append(clock() - start)
    return statistics.median(times[0]), statistics.median(times[1])


def process(*command: str, cwd: Path | None = None) -> Callable[[], object]:
    """A whole process as a call, its output thrown away; a failing one raises.

    Bytecode is kept between runs, as it is for an installed package, whatever the environment says.
    """
    own = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    quiet = subprocess.DEVNULL
    return lambda: subprocess.run(command, cwd=cwd, env=own, check=True, stdout=quiet, stderr=quiet)


def machine() -> str:
    """The machine in one line."""
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        names = [line.split(":", 1)[1].strip() for line in info.read_text().splitlines() if "model name" in line]
        model = f"{len(names)} × {names[0]}" if names else model
    return f"{model}, {platform.system()}, Python {platform.python_version()}"


def seconds(value: float) -> str:
    """A time with a unit that suits it."""
    for unit, scale in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if value >= scale:
            return f"{value / scale:.3g} {unit}"
    return f"{value * 1e9:.3g} ns"


def markdown(rows: Sequence[Row]) -> str:
    """The rows as a Markdown table, ratios first."""
    head = (
        "| what | ratio | bar | met | ours | time | against | time | accuracy |\n"
        "|---|---|---|---|---|---|---|---|---|\n"
    )
    return head + "".join(
        f"| {r.what} | **{r.ratio}** | {r.bar} | {'yes' if r.met else '**no**'} | {r.ours} | {seconds(r.ours_s)} "
        f"| {r.other} | {seconds(r.other_s)} | {r.accuracy} |\n"
        for r in rows
    )
