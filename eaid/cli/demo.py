"""`eaid demo`: every command, one after another, on the three datasets that ship with eaid."""

import contextlib
import io
from dataclasses import dataclass
from pathlib import Path

from eaid.cli import console
from eaid.cli.form import Common, takes, written
from eaid.errors import EaidError, UsageError


@dataclass(frozen=True, kw_only=True)
class Arguments(Common):
    """What `eaid demo` is told."""

    output: Path = written("demo", "Folder that the demo fills.")


@takes(Arguments)
def command(args: Arguments) -> None:
    """Ingest, fit, tune, simulate and report the three datasets that ship with eaid, into one folder.

    Needs no network and no rig. The data are synthetic; the page says so.

    Example: eaid demo -o demo
    """
    folder = args.output
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder}: is a file; give the demo a folder with -o")
    if not args.force and folder.is_dir() and any(folder.iterdir()):
        raise UsageError(f"{folder}: is not empty; give --force to write over it, or another -o")
    from eaid.synth.datasets import shipped

    data = {kind: str(path.resolve()) for kind, path in shipped().items()}
    folder.mkdir(parents=True, exist_ok=True)
    with console.progress("eaid demo", len(LINES)) as done:
        for line in LINES:
            run_line(tuple(data[word[1:-1]] if word[:1] == "{" else word for word in line), folder)
            done()
    console.be_quiet(args.quiet)
    page = folder / "report.html"
    if args.json:
        files = sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())
        console.print_json({"page": page, "files": files})
    for said in five_numbers(folder):
        console.line(said)
    console.done(page, f"{len(LINES)} commands", "open it in a browser")


def five_numbers(folder: Path) -> list[str]:
    """What the demo found, in five lines: fit %, T_s with its interval, errors, the worst margins, the guarantee."""
    from eaid.report.tables.gains import guarantee_words
    from eaid.results import codec
    from eaid.results.fit import Fit
    from eaid.results.gains import Gains

    fit = codec.read(folder / "fit.json", Fit)[0]
    gains = codec.read(folder / "gains.json", Gains)[0]
    assert fit.nonlinear is not None and gains.replayed is not None and gains.margins is not None
    level, worst, laws = fit.data.levels[-1], gains.margins.worst, ("rc", "pi")
    value, low, high = fit.at(level).loc["Ts"]
    rows = (
        ("fit of the nonlinear model", f"{fit.nonlinear.fit_pct:.1f} %"),
        (f"T_s at {level:g} {fit.data.input_unit}", f"{value:.3g} ({low:.3g} … {high:.3g}) {fit.data.output_unit}"),
        ("largest error, RC | PI", _two(*(getattr(gains.replayed, law).max_abs_error_nm for law in laws))),
        ("worst phase margin, RC | PI", _two(*(getattr(worst, law).phase_deg for law in laws))),
        ("guarantee", guarantee_words(gains)),
    )
    return [f"{name:<28}  {value}" for name, value in rows]


def _two(rc: float | None, pi: float | None) -> str:
    return " | ".join("–" if value is None else f"{value:.3g}" for value in (rc, pi))


Line = tuple[str, ...]
REPORTED = (
    "clutch.h5", "friction-force.h5", "friction-speed.h5", "fit.json", "friction-force.json", "friction-speed.json",
    "gains.json", "steps.h5", "multisine.h5", "sweep.h5", "rehab.h5",
)  # fmt: skip
LINES: tuple[Line, ...] = (
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
"""What the demo does, as typed inside its folder; {…} stands for the path of a shipped dataset."""


def run_line(line: Line, folder: Path) -> None:
    """One command line in this process, inside the folder: its tables are not shown, its failure ends the demo."""
    from eaid.cli.main import run

    with contextlib.chdir(folder), contextlib.redirect_stdout(io.StringIO()):
        code = run([*line, "--quiet", "--force"])
    if code not in (0, 4):  # 4: a fit did not converge; the page says so
        fault = EaidError(f"the demo stopped at: eaid {' '.join(line)} (exit code {code})")
        fault.exit_code = code
        raise fault
