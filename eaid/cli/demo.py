"""`eaid demo`: every command, one after another, on the three datasets that ship with eaid."""

import contextlib
import io
from pathlib import Path
from typing import Annotated

import typer

from eaid.cli import console
from eaid.cli.options import Force, Json, Quiet
from eaid.errors import UsageError

LINES: tuple[tuple[str, ...], ...] = (
    ("ingest", "{clutch}", "-o", "clutch.h5"),
    ("ingest", "{friction-force}", "-o", "friction-force.h5"),
    ("ingest", "{friction-speed}", "-o", "friction-speed.h5"),
    ("fit", "clutch.h5", "-o", "fit.json"),
    ("fit", "friction-force.h5", "-o", "friction-force.json"),
    ("fit", "friction-speed.h5", "-o", "friction-speed.json"),
    ("tune-rc", "fit.json", "-o", "gains.json"),
    ("simulate", "fit.json", "--gains", "gains.json", "--scenario", "steps", "-o", "steps.h5"),
    ("simulate", "fit.json", "--gains", "gains.json", "--scenario", "multisine", "-o", "multisine.h5"),
    ("simulate", "fit.json", "--gains", "gains.json", "--scenario", "sweep", "-o", "sweep.h5"),
    ("simulate", "fit.json", "--gains", "gains.json", "--scenario", "rehab", "-o", "rehab.h5"),
    ("plan", "fit.json", "-o", "plan.csv"),
    ("reproduce", "-o", "paper.md"),
)
"""What the demo does, as a user would type it inside its folder; the report of all of it comes last."""

REPORTED = (
    "clutch.h5", "friction-force.h5", "friction-speed.h5", "fit.json", "friction-force.json", "friction-speed.json",
    "gains.json", "steps.h5", "multisine.h5", "sweep.h5", "rehab.h5",
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
    lines = [tuple(data.get(word.strip("{}"), word) if word[:1] == "{" else word for word in line) for line in LINES]
    with contextlib.chdir(output), console.progress("eaid demo", len(lines) + 1) as done:
        for line in [*lines, report]:
            _run(line)
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


def _run(line: tuple[str, ...]) -> None:
    """One command line in this process: its tables are not shown, its failure ends the demo."""
    from eaid.cli.main import run

    with contextlib.redirect_stdout(io.StringIO()):
        code = run([*line, "--quiet", "--force"])
    if code not in (0, 4):  # 4: a fit did not converge; the page says so
        raise UsageError(f"the demo stopped at: eaid {' '.join(line)} (exit code {code})")
