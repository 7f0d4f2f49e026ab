"""`eaid demo`: every command, one after another, on the three datasets that ship with eaid."""

import contextlib
import io
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from eaid.cli import console
from eaid.cli.options import Force, Json, Quiet
from eaid.errors import EaidError, UsageError

CLUTCH: tuple[tuple[str, ...], ...] = (
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
FRICTION: tuple[tuple[str, ...], ...] = (
    ("ingest", "{friction-force}", "-o", "friction-force.h5"),
    ("ingest", "{friction-speed}", "-o", "friction-speed.h5"),
    ("fit", "friction-force.h5", "-o", "friction-force.json"),
    ("fit", "friction-speed.h5", "-o", "friction-speed.json"),
    ("reproduce", "-o", "paper.md"),
)
"""What needs nothing of the clutch: done beside it, on the second core."""

REPORTED = (
    "clutch.h5", "friction-force.h5", "friction-speed.h5", "fit.json", "friction-force.json", "friction-speed.json",
    "gains.json", "steps.h5", "multisine.h5", "sweep.h5", "rehab.h5", "log.h5",
)  # fmt: skip


def command(
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder that the demo fills.")] = Path("demo"),
    json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Ingest, fit, tune, simulate and report the three datasets that ship with eaid, into one folder.

    Needs no network and no rig. The data are synthetic; the page says so.
    """
    console.be_quiet(quiet)
    if output.exists() and not output.is_dir():
        raise UsageError(f"{output}: is a file; give the demo a folder with -o")
    if not force and output.is_dir() and any(output.iterdir()):
        raise UsageError(f"{output}: is not empty; give --force to write over it, or another -o")
    from eaid.synth.datasets import shipped

    data = {kind: str(path.resolve()) for kind, path in shipped().items()}
    output.mkdir(parents=True, exist_ok=True)
    report = ("report", *REPORTED, "-o", ".")
    with console.progress("eaid demo", len(CLUTCH) + len(FRICTION) + 1) as done:
        _both(_filled(CLUTCH, data), _filled(FRICTION, data), output, done)
        _run(report, output)
        done()
    console.be_quiet(quiet)
    page = output / "report.html"
    if json:
        console.print_json(
            {
                "page": str(page),
                "files": sorted(str(path.relative_to(output)) for path in output.rglob("*") if path.is_file()),
            }
        )
    console.say(f"done: open {page} in a browser")


def _filled(lines: tuple[tuple[str, ...], ...], data: dict[str, str]) -> list[tuple[str, ...]]:
    """The lines with the paths of the shipped datasets in them."""
    return [tuple(data[word[1:-1]] if word[:1] == "{" else word for word in line) for line in lines]


def _both(first: list[tuple[str, ...]], second: list[tuple[str, ...]], folder: Path, done: Callable[[], None]) -> None:
    """Run both lists, the second one in a process of its own where there is a processor for it."""
    from eaid.cli.fit_options import processors

    if processors() < 2:
        for line in [*first, *second]:
            _run(line, folder)
            done()
        return
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    from eaid.processes import end_with_parent

    with ProcessPoolExecutor(1, mp_context=get_context("spawn"), initializer=end_with_parent) as beside:
        waiting = [beside.submit(_run, line, folder) for line in second]
        try:
            for line in first:
                _run(line, folder)
                done()
            for each in waiting:
                each.result()
                done()
        except BaseException:
            beside.shutdown(cancel_futures=True)
            raise


def _run(line: tuple[str, ...], folder: Path) -> None:
    """One command line in this process, inside the folder: its tables are not shown, its failure ends the demo."""
    from eaid.cli.main import run

    with contextlib.chdir(folder), contextlib.redirect_stdout(io.StringIO()):
        code = run([*line, "--quiet", "--force"])
    if code not in (0, 4):  # 4: a fit did not converge; the page says so
        fault = EaidError(f"the demo stopped at: eaid {' '.join(line)} (exit code {code})")
        fault.exit_code = code
        raise fault
