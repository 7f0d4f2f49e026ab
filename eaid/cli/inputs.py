"""Logs and results as commands take them: read with progress, and stamped with what was typed."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from eaid.cli import console
from eaid.cli.form import Common
from eaid.errors import EaidError

if TYPE_CHECKING:
    from eaid.logs.run import Run
    from eaid.options import ReadOptions, TuneOptions
    from eaid.results.fit import Fit
    from eaid.steps.stepset import StepSet

R = TypeVar("R")


def runs_from(
    paths: Sequence[Path],
    options: "ReadOptions | None" = None,
    seen: Callable[[str], None] = lambda _: None,
) -> "tuple[list[Run], StepSet]":
    """Cut runs and their step set, with progress on stderr; `seen` as in `eaid.reading.read_steps`."""
    from eaid.options import ReadOptions
    from eaid.reading import read_steps

    return read_steps(paths, options or ReadOptions(logs_as="steps"), console.progress, console.warn, seen)


def logs_of(fitted: "Fit", fit: Path, data: list[Path] | None, options: "TuneOptions") -> "StepSet | None":
    """The logs given, or those that the fit names, where they are wanted, still there and unchanged."""
    from eaid.files import sha256_of
    from eaid.options import ReadOptions

    if data:
        return runs_from(data)[1]
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
        return runs_from(paths, ReadOptions(**{**fitted.options.reading, "logs_as": "steps"}))[1]  # type: ignore[arg-type]
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
