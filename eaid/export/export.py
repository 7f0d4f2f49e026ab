"""Gains and plant → a folder that a rig is run from: written whole or not at all."""

from dataclasses import dataclass
from pathlib import Path

from eaid.errors import UsageError
from eaid.export.job import UNKNOWN, Origin, constants_of, job_of, laws_of, timing_of
from eaid.export.judge import judged
from eaid.export.made_from import source_of
from eaid.export.targets import TARGETS
from eaid.files import folder_written_whole, refuse_inputs_within
from eaid.findings import Finding
from eaid.options import ExportOptions
from eaid.results.fit import Fit
from eaid.results.gains import Gains

OURS = ("eaid_*", "vectors.*", "check*", "Makefile", "README.md", "parameters.*", "*.ino", "*.o")
"""Names of an export's files and of what its Makefile builds; a folder with any other in it is never replaced."""


@dataclass(frozen=True)
class ExportFolder:
    """What was written."""

    path: Path
    target: str
    laws: tuple[str, ...]
    files: tuple[str, ...]
    dt_s: float
    findings: tuple[Finding, ...]
    """What stands at the head of each file, the gravest first."""


def export(
    gains: Gains | None, fit: Fit | None, options: ExportOptions, folder: Path, force: bool = False,
    origin: Origin = UNKNOWN,
) -> ExportFolder:  # fmt: skip
    """Write controllers and plant as source for a rig; without gains the fit's inverse and plant alone.

    Raises
    ------
    GainsError
        A loop is unstable at the sample rate, or a finding of severity stop stands; `anyway` overrides, marked.
    UsageError
        The options contradict one another, or the folder is there already.
    """
    refuse_folder(folder, force)
    refuse_inputs_within(folder, (Path(each.path) for each in origin.inputs))
    source = source_of(gains, fit)
    laws = laws_of(source, options)
    if {"inverse", "plant"} & set(laws) and source.plant is not None and source.plant.falls_as_release:
        raise UsageError(
            "the fit's falls between levels are as quick as its release, which an exported plant does not know; "
            "export the controllers alone, «law» pi,rc"
        )
    timing = timing_of(source, options)
    constants = constants_of(source, laws, timing)
    found = judged(source, laws, 1.0 / timing.dt_s, options)
    job = job_of(source, constants, timing, found, options, folder.resolve().name, origin)
    files = dict(TARGETS[options.target](job))
    with folder_written_whole(folder) as part:
        for name, content in files.items():
            data = content if isinstance(content, bytes) else content.encode("utf-8")
            (part / name).write_bytes(data)
        refuse_folder(folder, force)
    return ExportFolder(folder, options.target, laws, tuple(files), timing.dt_s, found)


def refuse_folder(folder: Path, force: bool) -> None:
    """Leave an existing folder alone unless it is an earlier export and the user says so."""
    if not folder.exists() and not folder.is_symlink():
        if not folder.resolve().parent.is_dir():
            raise UsageError(f"{folder}: the folder {folder.resolve().parent} does not exist; make it first")
        return
    if not folder.is_dir():
        raise UsageError(f"{folder}: is no folder; give another «output»")
    items = sorted(folder.iterdir())
    strange = [
        one for one in items if one.is_symlink() or not one.is_file() or not any(map(one.match, (*OURS, ".*.part")))
    ]
    if strange:
        raise UsageError(f"{folder}: holds {strange[0].name}, which eaid export did not make; give another «output»")
    if items and not force:
        raise UsageError(f"{folder}: exists already; give «force» to overwrite it, or another «output»")
