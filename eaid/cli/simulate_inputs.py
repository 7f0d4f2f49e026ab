"""What `eaid simulate` is given as files and as text."""

from pathlib import Path
from typing import TYPE_CHECKING

from eaid.cli import console
from eaid.errors import UsageError

if TYPE_CHECKING:
    from eaid.logs.run import Run
    from eaid.results.replay import Head


def factors(text: str | None) -> dict[str, float]:
    """`Ts=0.9,tau1=1.2` as numbers."""
    found: dict[str, float] = {}
    for part in (text or "").split(","):
        name, _, value = part.partition("=")
        if not part.strip():
            continue
        if name.strip() in found:
            raise UsageError(f"--perturb says {name.strip()} twice; give each factor once")
        try:
            found[name.strip()] = float(value)
        except ValueError:
            raise UsageError(f"--perturb has {part.strip()!r}; write factors as Ts=0.9,tau1=1.2") from None
    return found


def runs_of(log: list[Path], columns: str | None, units: str | None, repair: bool, variable: str | None) -> "list[Run]":
    """The recorded runs of some logs."""
    from eaid.logs.folders import files_of
    from eaid.logs.options import ReadOptions
    from eaid.logs.read import read_runs
    from eaid.reading import pairs

    reading = ReadOptions(
        columns=pairs("--columns", columns), units=pairs("--units", units), repair=repair, variable=variable
    )
    return list(read_runs(files_of(log, console.warn), reading))


def with_inputs(head: "Head", fit: Path, gains: Path | None, reference: Path | None, log: list[Path] | None) -> "Head":
    """What a replay says of itself, with the files that it was made from."""
    import msgspec

    from eaid.results.common import Input
    from eaid.results.replay import ReplayInputs

    def one(path: Path | None) -> Input | None:
        return None if path is None else Input.of(path)

    logs = tuple(Input.of(each) for each in log or () if each.is_file())
    return msgspec.structs.replace(head, inputs=ReplayInputs(one(fit), one(gains), one(reference), logs))
