"""What the shell offers behind an option: its words, or the levels of the data that stand on the line already."""

from collections.abc import Callable, Sequence
from pathlib import Path

import typer


def completion(words: Sequence[str], several: bool, levels: bool) -> Callable[..., list[str]] | None:
    """What the shell offers: the words, or the levels that the data hold; nothing where it offers files."""
    if levels:
        return _levels
    if not words:
        return None

    def offered(incomplete: str) -> list[str]:
        before, comma, last = incomplete.rpartition(",") if several else ("", "", incomplete)
        return [before + comma + word for word in words if word.startswith(last)]

    return offered


def _levels(ctx: typer.Context, incomplete: str) -> list[str]:
    """The levels of the fit or the dataset that stands on the line already."""
    placed = [ctx.params.get(name) or () for name in ("data", "logs", "fit", "plant")]
    words = [word for each in placed for word in (each if isinstance(each, list | tuple) else [each])]
    paths = [Path(word) for word in (*words, *ctx.args)]  # what Typer has not yet given a name stands in `args`
    before, comma, last = incomplete.rpartition(",")
    return [before + comma + level for level in levels_in(paths) if level.startswith(last)]


def levels_in(paths: Sequence[Path]) -> list[str]:
    """The levels of a fit.json or a data.h5, for the shell; none of anything else."""
    import json

    import h5py

    levels: set[float] = set()
    for path in paths:
        try:
            if path.suffix == ".json":
                levels |= set(json.loads(path.read_text(encoding="utf-8"))["data"]["levels"])
            else:
                with h5py.File(path) as file:
                    levels |= {float(run.attrs["level"]) for run in file["runs"].values() if "level" in run.attrs}
        except (OSError, ValueError, KeyError, TypeError):
            continue
    return [f"{level:g}" for level in sorted(levels)]
