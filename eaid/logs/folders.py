"""Which files are meant: what a folder of logs holds, its logs, and what lies beside them in any lab; dataset.toml.

A file given by name is always read, or refused. In a folder, files with the ending of a log are logs, and so are others
that hold rows of numbers; the rest is left out, and told in one sentence.

dataset.toml holds what has to be said of a folder of logs: the options of `eaid ingest --write-manifest`, of which
those that are typed win, and, written by hand, logs that are not to be read with the reason why:

    [exclude]
    "u60_3.csv" = "belt slipped"
"""

import json
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import msgspec

from eaid.declared import given_options
from eaid.errors import DataError, UsageError
from eaid.files import LOG_ENDINGS, is_as_written, written_whole
from eaid.logs.formats import format_of
from eaid.logs.table import plain
from eaid.logs.text import has_table, lines_of
from eaid.options import ReadOptions
from eaid.shown import listed

# Endings that a folder of logs also holds and that are no logs: passed over in silence
SKIPPED = (
    ".md", ".txt~", ".part", ".json", ".png", ".jpg", ".jpeg", ".pdf", ".svg", ".html", ".toml", ".py", ".m", ".slx",
    ".mdl", ".yaml", ".yml", ".docx", ".pptx", ".ini",
)  # fmt: skip
JUDGED_BYTES = 1 << 16  # Bytes of a text by which it is judged
MANIFEST = "dataset.toml"
MANIFEST_SCHEMA = "eaid/manifest/2"
WRITE_AGAIN = "write it again with «write_manifest» of eaid ingest"
ManifestValue = str | float | bool


def files_of(paths: Iterable[Path], tell: Callable[[str], None] = lambda _: None) -> list[Path]:
    """The files behind what the user gave, a folder for the logs in it; `tell` gets a sentence of what is left out."""
    files: list[Path] = []
    faults: list[str] = []
    for path in paths:
        if path.is_dir():
            inside, others = _sorted_out(path)
            if not inside:
                besides = f" (left out: {listed(others, 5)})" if others else ""
                deeper = [one.name for one in sorted(path.iterdir()) if one.is_dir() and _sorted_out(one)[0]]
                remedy = f"give those within: {path}/*" if deeper else "give the folder that does"
                holds = f" by itself, but {listed(deeper, 5)} do" if deeper else ""
                faults.append(f"{path}: holds no logs{holds}{besides}; {remedy}")
            elif others:
                tell(f"{path}: left out as no logs: {listed(others, 5)}; a file given by name is always read")
            files.extend(inside)
        elif path.exists():
            files.append(path)
        else:
            faults.append(f"{path}: no such file or folder; check the path")
    for file in files:
        if str(file).encode(errors="replace").decode() != str(file):
            faults.append(f"{file}: its name, or that of its folder, is not UTF-8; rename it")
        elif not str(file).isprintable():
            faults.append(f"{plain(str(file))}: its name, or that of its folder, holds characters that no one sees; "
                          f"rename it")  # fmt: skip
    if faults:
        raise DataError(*faults)
    twice = [path for path, count in Counter(file.resolve() for file in files).items() if count > 1]
    if twice:
        raise UsageError(f"{twice[0]}: is given twice; a log counts once")
    return files


def _sorted_out(folder: Path) -> tuple[list[Path], list[str]]:
    """The logs of a folder, and the names of what is left out, each in order."""
    kinds = {
        item: _kind_in_folder(item)
        for item in sorted(folder.iterdir())
        if item.is_file() and item.name[0] != "." and item.suffix.lower() not in SKIPPED and item.name != "Thumbs.db"
    }
    # a dataset beside logs was most likely made from them, a workbook holds their results; a log counts once
    wanted = next((kind for kind in ("log", "Excel") if kind in kinds.values()), "data")
    return [item for item in kinds if kinds[item] == wanted], [item.name for item in kinds if kinds[item] != wanted]


def _kind_in_folder(path: Path) -> str:
    """log, Excel, data or replay of a file in a folder, by its ending, first bytes, or rows of numbers in a text."""
    ending = path.suffix.lower()
    if ending in LOG_ENDINGS:
        return "log"
    try:
        if is_as_written(path):
            import h5py

            with h5py.File(path, "r", locking=False) as file:
                return str(file.attrs["schema"]).split("/")[1]
        with path.open("rb") as raw:
            head = raw.read(JUDGED_BYTES)
    except OSError:
        return "log"  # refused by its name
    form = format_of(head[:4096]).name
    if form == "Excel":
        return form
    rows = has_table(lines_of(head)) if form == "text" else form != "not read"
    return "log" if rows or ending in (".h5", ".hdf5") else ""


class Manifest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Options and left-out logs of a folder."""

    schema: str
    options: dict[str, ManifestValue] = {}
    exclude: dict[str, str] = {}  # Name of a log → why it is not to be read


def files_read(paths: Sequence[Path]) -> Iterator[Path]:
    """All that is read where these paths are given: a folder, or its manifest, stands for its logs, too."""
    yield from paths
    yield from files_of(path for path in map(_folder, paths) if path.is_dir())


def _folder(path: Path) -> Path:
    """The folder that a manifest is of; any other path as it is."""
    return path.parent if path.suffix == ".toml" and path.is_file() else path


def read_manifest(path: Path) -> Manifest:
    """What a dataset.toml says; `DataError` for one that is not as this eaid writes it."""
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (ValueError, RecursionError) as fault:  # no TOML, no UTF-8, nested too deep, a number of thousands of digits
        raise DataError(f"{path}: is no TOML ({fault}); {WRITE_AGAIN}") from None
    if content.get("schema") != MANIFEST_SCHEMA:
        raise DataError(
            f"{path}: its schema is {content.get('schema')!r}, and this eaid reads {MANIFEST_SCHEMA!r}; {WRITE_AGAIN}"
        )
    try:
        return msgspec.convert(content, Manifest)
    except msgspec.ValidationError as fault:
        raise DataError(f"{path}: {str(fault).replace('$.', '')}; mend it, or {WRITE_AGAIN}") from None


def logs_meant(
    paths: Sequence[Path], options: ReadOptions, warn: Callable[[str], None]
) -> tuple[list[Path], ReadOptions]:
    """The files behind what is given, and the options with those of a manifest: the one that is given itself, or lies
    in the one folder that is given, or beside all files that are given, none of them a dataset.

    Raises DataError where it is not written as this eaid writes it; `warn` hears what is left out.
    """
    inside = [path if _folder(path) != path else path / MANIFEST for path in paths]
    manifests = [path for path in inside if path.is_file()]
    if manifests and len(paths) > 1:
        raise UsageError(f"{manifests[0]}: says all about its own logs; give it, or its folder, alone")
    files = files_of(map(_folder, paths), warn)
    beside = {file.parent / MANIFEST for file in files}
    if not manifests and len(beside) == 1 and all(path.is_file() for path in paths):
        manifests = [path for path in beside if path.is_file() and not any(map(is_as_written, files))]
    if not manifests:
        return files, options
    path, manifest = manifests[0], read_manifest(manifests[0])
    if gone := [name for name in manifest.exclude if not (path.parent / name).is_file()]:
        raise DataError(f"{path}: its log {plain(gone[0])} is not there; put it back or take it off")
    out = [file for file in files if file.name in manifest.exclude]
    if out:
        each = ", ".join(f"{file.name}: {manifest.exclude[file.name] or 'no reason given'}" for file in out)
        warn(f"{path}: {len(out)} of {len(files)} logs excluded ({each})")
    if len(out) == len(files):
        raise DataError(f"{path}: excludes all its logs; take exclude off one")
    return [file for file in files if file not in out], given_options(
        ReadOptions, None, {**manifest.options, **options.given()}
    )


def write_manifest(files: Sequence[Path], options: Mapping[str, ManifestValue], force: bool = False) -> Path:
    """Write `dataset.toml` beside the logs with the options as given on the command line; returns its path.

    Raises UsageError where the logs lie in several folders.
    """
    if len({file.resolve().parent for file in files}) != 1:
        raise UsageError("«write_manifest»: the logs lie in several folders; put them into one")
    path = files[0].parent / MANIFEST
    # TOML writes texts, numbers and truths as JSON does
    values = [f"{name} = {json.dumps(value, ensure_ascii=False)}" for name, value in options.items()]
    with written_whole(path, force=force) as (part,):
        part.write_text("\n".join([f'schema = "{MANIFEST_SCHEMA}"', "", "[options]", *values, ""]), encoding="utf-8")
    return path
