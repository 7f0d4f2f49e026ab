"""The command lines of the demo, and how they are run: in this process, those of the friction rigs in one beside it."""

import contextlib
import io
from collections.abc import Callable
from pathlib import Path

from eaid.errors import EaidError

Line = tuple[str, ...]
CLUTCH: tuple[Line, ...] = (
    ("ingest", "{clutch}", "-o", "clutch.h5"),
    ("fit", "clutch.h5", "-o", "fit.json"),
    ("tune-rc", "fit.json", "-o", "gains.json"),
    ("simulate", "fit.json", "--gains", "gains.json", "--scenario", "steps", "-o", "steps.h5"),
    ("simulate", "fit.json", "--gains", "gains.json", "--scenario", "multisine", "-o", "multisine.h5"),
    ("simulate", "fit.json", "--gains", "gains.json", "--scenario", "sweep", "-o", "sweep.h5"),
    ("simulate", "fit.json", "--gains", "gains.json", "--scenario", "rehab", "-o", "rehab.h5"),
    ("simulate", "fit.json", "--log", "clutch.h5", "-o", "log.h5"),
    ("plan", "fit.json", "-o", "plan.csv"),
)
"""What the demo does with the clutch, as a user would type it inside the demo's folder."""
FRICTION: tuple[Line, ...] = (
    ("ingest", "{friction-force}", "-o", "friction-force.h5"),
    ("ingest", "{friction-speed}", "-o", "friction-speed.h5"),
    ("fit", "friction-force.h5", "-o", "friction-force.json"),
    ("fit", "friction-speed.h5", "-o", "friction-speed.json"),
)
"""What needs nothing of the clutch: done beside it, on the second core."""

REPORTED = (
    "clutch.h5", "friction-force.h5", "friction-speed.h5", "fit.json", "friction-force.json", "friction-speed.json",
    "gains.json", "steps.h5", "multisine.h5", "sweep.h5", "rehab.h5", "log.h5",
)  # fmt: skip


def filled(lines: tuple[Line, ...], data: dict[str, str]) -> list[Line]:
    """The lines with the paths of the shipped datasets in them."""
    return [tuple(data[word[1:-1]] if word[:1] == "{" else word for word in line) for line in lines]


def run_both(first: list[Line], second: list[Line], folder: Path, done: Callable[[], None]) -> None:
    """Run both lists, the second one in a process of its own."""
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    from eaid.processes import end_with_parent

    with ProcessPoolExecutor(1, mp_context=get_context("spawn"), initializer=end_with_parent) as beside:
        waiting = [beside.submit(run_line, line, folder) for line in second]
        try:
            for line in first:
                run_line(line, folder)
                done()
            for each in waiting:
                each.result()
                done()
        except BaseException:
            beside.shutdown(cancel_futures=True)
            raise


def run_line(line: Line, folder: Path) -> None:
    """One command line in this process, inside the folder: its tables are not shown, its failure ends the demo."""
    from eaid.cli.main import run

    with contextlib.chdir(folder), contextlib.redirect_stdout(io.StringIO()):
        code = run([*line, "--quiet", "--force"])
    if code not in (0, 4):  # 4: a fit did not converge; the page says so
        fault = EaidError(f"the demo stopped at: eaid {' '.join(line)} (exit code {code})")
        fault.exit_code = code
        raise fault
