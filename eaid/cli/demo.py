"""`eaid demo`: every command, one after another, on the three datasets that ship with eaid."""

import contextlib
import io
from pathlib import Path

from eaid.cli import console
from eaid.cli.form import Common, takes, written
from eaid.errors import EaidError, UsageError


@takes
def demo(args: Common, output: Path = written("demo", "Folder that the demo fills.")) -> None:
    """Ingest, fit, tune, simulate and report the three datasets that ship with eaid, into one folder.

    Needs no network and no rig. The data are synthetic; the page says so.

    Example: eaid demo -o demo
    """
    if output.exists() and not output.is_dir():
        raise UsageError(f"{output}: is a file; give the demo a folder with -o")
    if not args.force and output.is_dir() and any(output.iterdir()):
        raise UsageError(f"{output}: is not empty; give --force to write over it, or another -o")
    from eaid.synth.files import shipped

    data = {kind: str(path.resolve()) for kind, path in shipped().items()}
    output.mkdir(parents=True, exist_ok=True)
    with console.progress("eaid demo", len(LINES)) as done:
        for line in LINES:
            run_line(tuple(data[word[1:-1]] if word[:1] == "{" else word for word in line), output)
            done()
    page = output / "report.html"
    if args.json:
        files = sorted(str(path.relative_to(output)) for path in output.rglob("*") if path.is_file())
        console.print_json({"page": page, "files": files})
    console.done(page, f"{len(LINES)} commands", "open it in a browser")


REPORTED = (
    "clutch.h5", "friction-force.h5", "friction-speed.h5", "fit.json", "friction-force.json", "friction-speed.json",
    "gains.json", "steps.h5", "multisine.h5", "sweep.h5", "rehab.h5",
)  # fmt: skip
# What the demo does, as typed inside its folder; {…} stands for the path of a shipped dataset
LINES: tuple[tuple[str, ...], ...] = (
    ("ingest", "{friction-force}", "-o", "friction-force.h5"),
    ("ingest", "{friction-speed}", "-o", "friction-speed.h5"),
    ("fit", "friction-force.h5", "-o", "friction-force.json"),
    ("fit", "friction-speed.h5", "-o", "friction-speed.json"),
    ("ingest", "{clutch}", "-o", "clutch.h5"),
    ("fit", "clutch.h5", "-o", "fit.json"),
    ("tune-rc", "fit.json", "-o", "gains.json"),
    ("simulate", "fit.json", "gains.json", "--scenario", "steps", "-o", "steps.h5"),
    ("simulate", "fit.json", "gains.json", "--scenario", "multisine", "-o", "multisine.h5"),
    ("simulate", "fit.json", "gains.json", "--scenario", "sweep", "-o", "sweep.h5"),
    ("simulate", "fit.json", "gains.json", "--scenario", "rehab", "-o", "rehab.h5"),
    ("plan", "fit.json", "-o", "plan.csv"),
    ("report", *REPORTED, "-o", "."),
)


def run_line(line: tuple[str, ...], folder: Path) -> None:
    """One command line in this process, inside the folder: its tables are not shown, its failure ends the demo."""
    from eaid.cli.main import run

    with contextlib.chdir(folder), contextlib.redirect_stdout(io.StringIO()):
        code = run([*line, "--quiet", "--force"])
    if code not in (0, 4):  # 4: a fit did not converge; the page says so
        fault = EaidError(f"the demo stopped at: eaid {' '.join(line)} (exit code {code})")
        fault.exit_code = code
        raise fault
