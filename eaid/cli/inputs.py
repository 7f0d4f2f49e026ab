"""Logs as every command takes them: the reading options, declared once, and the one function that reads."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from eaid.cli import console
from eaid.cli.form import Common, option, taken
from eaid.cli.words import as_typed
from eaid.errors import EaidError

if TYPE_CHECKING:
    from eaid.logs.run import Run
    from eaid.reading import InputOptions
    from eaid.results.fit import Fit
    from eaid.results.tuning import TuneOptions
    from eaid.steps.stepset import StepSet

R = TypeVar("R")
READING, STEPS = "Reading logs", "Finding steps"
KINDS = ("clutch", "friction-force", "friction-speed")
LONG_LOG = 1 << 26
"""Size of a log [bytes] above which its reading is told tenth by tenth."""


@dataclass(frozen=True, kw_only=True)
class Columns:
    """Which columns of a log are which."""

    columns: str | None = option(
        None, 'Column of each role, by name or number: time=Time,input=Volts,output="Load Cell".', READING,
        shown="ROLE=NAME,…",
    )  # fmt: skip
    units: str | None = option(
        None, "Unit of a column: time=us,output=g; input=/255: 255 counts are the full scale.", READING,
        shown="ROLE=UNIT,…",
    )  # fmt: skip
    variable: str | None = option(
        None, "Table of a file with several: a MAT variable, an HDF5 path, a TDMS group.", READING, shown="NAME"
    )
    repair: bool = option(False, "Drop bad rows, up to 1 % of a log, and say how many.", READING)


@dataclass(frozen=True, kw_only=True)
class Reading(Columns):
    """All that may be said about logs: the fields of `eaid.reading.InputOptions`."""

    name_pattern: str | None = option(
        None, "Level and repeat from file names, anywhere in them: '_V={level}_', 'run{repeat}'.", READING,
        shown="PATTERN",
    )  # fmt: skip
    rate_hz: float | None = option(None, "Samples a second of logs without a time column [Hz].", READING)
    join: bool = option(False, "The logs are one run that the logger cut: join them by time.", READING)
    sign: str = option("auto", "Turn an output that was recorded inverted, or never.", READING, words="auto|keep")
    kind: str | None = option(None, "Experiment; by itself from the columns.", STEPS, words=KINDS)
    levels: str | None = option(None, "Levels to keep: 30:100 or 30,40,90.", STEPS, levels=True)
    baseline: str = option(
        "auto", "Value before each step: its last rest, the first samples, none, a value, or a window in s to it.",
        STEPS, words="auto|first|none", read=as_typed, shown="WORD|VALUE|FROM:TO",
    )  # fmt: skip
    rest: float = option(0.0, "Input at rest, in its own unit; levels are counted from it.", STEPS)
    step_at: float | None = option(None, "Step instant, in seconds of the log.", STEPS)
    until: float | None = option(None, "End of the active window, in seconds of the log.", STEPS)
    apparatus: str | None = option(
        None, "The rig, where it is not the paper's: surfaces=1,inner_radius_m=0.03.", STEPS, shown="NAME=VALUE,…"
    )


def reading_of(args: Columns) -> "InputOptions":
    """The reading options that were typed."""
    from eaid.reading import InputOptions

    return taken(InputOptions, args)


def runs_from(
    paths: Sequence[Path],
    options: "InputOptions | None" = None,
    whole: str = "steps",
    seen: Callable[[str], None] = lambda _: None,
) -> "tuple[list[Run], StepSet]":
    """Cut runs and their step set, with progress on stderr; `whole` and `seen` as in `eaid.reading.read_steps`."""
    from eaid.reading import InputOptions, read_steps

    long = any(path.is_file() and path.stat().st_size > LONG_LOG for path in paths)
    tell = _tenths() if long else lambda _source, _share: None
    return read_steps(paths, options or InputOptions(), console.progress, console.warn, tell, whole, seen)


def _tenths() -> Callable[[str, float], None]:
    """Tells how much of each long log is read, once a tenth."""
    done: dict[str, int] = {}

    def tell(source: str, share: float) -> None:
        tenth = int(10 * share)
        if tenth > done.get(source, 0):
            done[source] = tenth
            console.progressed(f"{source}: {10 * tenth} % read")

    return tell


def logs_of(fitted: "Fit", fit: Path, data: list[Path] | None, options: "TuneOptions") -> "StepSet | None":
    """The logs given, or those that the fit names, where they are wanted, still there and unchanged."""
    from eaid.files import sha256_of

    if data:
        return runs_from(data)[1]
    wants = {"φ": options.phi == "data", "the noise": options.optimize and options.noise_nm is None}
    wanted = " and ".join(name for name, asked in wants.items() if asked)
    if not wanted:
        return None
    instead = f"so {wanted} cannot be read off them; give the logs with --data"
    if not fitted.data.inputs:
        console.warn(f"{fit}: names no logs, {instead}")
        return None
    paths = []
    for record in fitted.data.inputs:
        told = Path(record.path)
        found = next((path for path in (told, fit.parent / told.name) if path.is_file()), None)
        if found is None or sha256_of(found) != record.sha256:
            console.warn(f"{told}: is gone or has changed, {instead}")
            return None
        paths.append(found)
    try:
        return runs_from(paths)[1]
    except EaidError as fault:
        console.warn(f"{fault.sentences[0]}: {instead}")
        return None


def stamped(result: R, args: Common, kind: type, **files: Path | list[Path] | None) -> R:
    """A result that says what was typed, and names the files it was made from by their roles in `kind`."""
    import msgspec

    from eaid.results.common import Input

    named = {
        role: tuple(Input.of(one) for one in given if one.is_file()) if isinstance(given, list) else Input.of(given)
        for role, given in files.items()
        if given
    }
    return msgspec.structs.replace(result, inputs=kind(**named), command=args.words)  # type: ignore[type-var]
