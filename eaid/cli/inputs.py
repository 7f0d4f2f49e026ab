"""Logs and results as commands take them: read with progress, and stamped with what was typed."""

from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from eaid.cli import console
from eaid.cli.form import Common
from eaid.errors import EaidError

if TYPE_CHECKING:
    from eaid.options import TuneOptions
    from eaid.results.fit import Fit
    from eaid.steps.stepset import StepSet

R = TypeVar("R")


def logs_of(fitted: "Fit", fit: Path, data: list[Path] | None, options: "TuneOptions") -> "StepSet | None":
    """The logs given, or those that the fit names, where they are wanted, still there and unchanged."""
    from eaid.files import sha256_of
    from eaid.options import ReadOptions
    from eaid.reading import read_steps

    if data:
        return read_steps(data, ReadOptions(logs_as="steps"), console.progress, console.warn)[1]
    if options.phi != "data":
        return None
    instead = "so φ cannot be read off them; give the logs with --data"
    named = fitted.data.inputs or fitted.data.sources  # of a folder each log is named
    if not named:
        console.warn(f"{fit}: names no logs, {instead}")
        return None
    paths: list[Path] = []
    for record in named:
        recorded = Path(record.path)
        file = next((path for path in (recorded, fit.parent / recorded.name) if path.is_file()), None)
        if file is None or sha256_of(file) != record.sha256:
            console.warn(f"{recorded}: is gone or has changed, {instead}")
            return None
        paths += [file] * (file not in paths)
    try:
        reading = ReadOptions(**{**fitted.options.reading, "logs_as": "steps"})  # type: ignore[arg-type]
        return read_steps(paths, reading, console.progress, console.warn)[1]
    except EaidError as fault:
        console.warn(f"{fault.sentences[0]}: {instead}")
        return None


def stamped(result: R, args: Common, **files: Path | list[Path] | None) -> R:
    """A result that says what was typed, and names the files it was made from."""
    import msgspec

    from eaid.results.common import Input

    named = {
        role: tuple(Input.of(one) for one in given if one.is_file()) if isinstance(given, list) else Input.of(given)
        for role, given in files.items()
        if given
    }
    return msgspec.structs.replace(result, inputs=named, command=args.typed)  # type: ignore[type-var]
