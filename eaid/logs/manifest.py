"""dataset.toml: what has to be said of a folder of logs, kept beside them.

The options of `eaid ingest --write-manifest`, and for each log its fingerprint, its repeat and, where the log does not
say it itself, its level. Options that are typed win.
"""

import contextlib
import json
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import msgspec

from eaid.declared import forms
from eaid.errors import DataError, UsageError
from eaid.files import sha256_of, written_whole
from eaid.findings import finding
from eaid.logs.folders import files_of
from eaid.logs.run import Run
from eaid.logs.table import plain
from eaid.options import ReadOptions

NAME = "dataset.toml"
SCHEMA = "eaid/manifest/1"
WRITE_AGAIN = "write it again with «write_manifest» of eaid ingest"
Value = str | float | bool
Number = Annotated[float, msgspec.Meta(ge=-1e12, le=1e12)]


# Options that a manifest may hold, under the names of the command line
Options = msgspec.defstruct(
    "Options", [(name, (next((kind for kind in (bool, float) if kind in form.parts), str)) | None, None)
     for name, form in forms(ReadOptions).items()],
    frozen=True, forbid_unknown_fields=True, omit_defaults=True,
)  # fmt: skip


class Entry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One log of a manifest."""

    file: str  # Its path; in the file itself, beside the manifest
    sha256: str | None = None
    level: Number | None = None  # For logs without an input column
    repeat: Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)] | None = None
    step_s: Number | None = None
    until_s: Number | None = None
    exclude: str | None = None  # Why it is not to be read


class Manifest(msgspec.Struct, frozen=True):
    """Options and logs of a folder."""

    path: Path = Path()
    options: Options = Options()  # type: ignore[valid-type]
    log: tuple[Entry, ...] = ()


def files_read(paths: Sequence[Path]) -> Iterator[Path]:
    """All that is read where these paths are given: a folder and a manifest stand for what they hold, too."""
    yield from paths
    manifest = manifest_of(paths)
    folders = [path for path in paths if path.is_dir()]
    yield from files_of(folders) if manifest is None else (Path(entry.file) for entry in manifest.log)


def manifest_of(paths: Sequence[Path]) -> Manifest | None:
    """The manifest that is meant: given itself, or lying in the one folder that is given, or beside logs that are given
    and that it lists, then of those alone; None where there is none.

    Raises DataError where it is not written as this eaid writes it.
    """
    manifests = [path / NAME for path in paths if (path / NAME).is_file()]
    manifests += [path for path in paths if path.suffix == ".toml" and path.is_file()]
    if not manifests:
        beside = {path.parent / NAME for path in paths}
        with contextlib.suppress(DataError, KeyError):  # a bad one, or one that does not list them all
            if len(beside) == 1 and (one := beside.pop()).is_file() and (whole := manifest_of([one])) is not None:
                listed = {entry.file: entry for entry in whole.log}
                return msgspec.structs.replace(whole, log=tuple(listed[str(path)] for path in paths))
        return None
    if len(paths) > 1:
        raise UsageError(f"{manifests[0]}: says all about its own logs; give it, or its folder, alone")
    path = manifests[0]
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (ValueError, RecursionError) as fault:  # no TOML, no UTF-8, nested too deep, a number of thousands of digits
        raise DataError(f"{path}: is no TOML ({fault}); {WRITE_AGAIN}") from None
    if content.get("schema") != SCHEMA:
        raise DataError(
            f"{path}: its schema is {content.get('schema')!r}, and this eaid reads {SCHEMA!r}; {WRITE_AGAIN}"
        )
    try:
        manifest = msgspec.convert(content, Manifest)
    except msgspec.ValidationError as fault:
        raise DataError(f"{path}: {str(fault).replace('$.', '')}; mend it, or {WRITE_AGAIN}") from None
    if not manifest.log:
        raise DataError(f"{path}: lists no logs; {WRITE_AGAIN}")
    logs = tuple(msgspec.structs.replace(entry, file=str(path.parent / entry.file)) for entry in manifest.log)
    outside = next((entry.file for entry in manifest.log if Path(entry.file).name != entry.file), None)
    if outside is not None:
        raise DataError(f"{path}: its log {plain(outside)} lies outside its folder; put it there")
    if missing := [plain(Path(entry.file).name) for entry in logs if not Path(entry.file).is_file()]:
        raise DataError(*(f"{path}: its log {name} is not there; put it back or take it off" for name in missing))
    return msgspec.structs.replace(manifest, path=path, log=logs)


def apply(entry: Entry, run: Run) -> Run:
    """A run with what the manifest says of its log where the log does not say it itself."""
    findings = run.findings
    if entry.sha256 and run.sha256 != entry.sha256:
        findings = (*findings, finding("log-changed", run.name))
    level = entry.level if run.input.size and not run.has_input and entry.level is not None else run.level
    run = replace(run, findings=findings, level=level)
    if run.cut:
        return run
    step_s = run.step_s if entry.step_s is None else entry.step_s - run.start_s
    until_s = run.until_s if entry.until_s is None else entry.until_s - run.start_s
    return replace(run, repeat=run.repeat if entry.repeat is None else entry.repeat, step_s=step_s, until_s=until_s)


def _toml(**values: Value | None) -> list[str]:
    """Lines `name = value` for the values that are given; TOML writes texts, numbers and truths as JSON does."""
    return [f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in values.items() if value is not None]


def write_manifest(
    files: Sequence[Path], runs: Sequence[Run], options: Mapping[str, Value | None], force: bool = False
) -> Path:
    """Write `dataset.toml` beside the logs from what they hold; returns its path.

    `runs` are cut; `options` as given on the command line. Raises UsageError where the logs lie in several folders.
    """
    if len({file.resolve().parent for file in files}) != 1:
        raise UsageError("«write_manifest»: the logs lie in several folders; put them into one")
    path = files[0].parent / NAME
    given = {key: options[key] for key in Options.__struct_fields__ if options.get(key) not in (None, False)}
    lines = [*_toml(schema=SCHEMA), "", "[options]", *_toml(**given)]
    for file in files:
        lines += ["", "[[log]]", *_toml(file=file.name, sha256=sha256_of(file))]
        rising = [run for run in runs if run.source == str(file) and run.edge == "rising"]
        if len(rising) == 1 and rising[0].from_level == 0 and not rising[0].dataset:
            # its instant is looked for anew: it may be wrong
            lines += _toml(repeat=rising[0].repeat, level=None if rising[0].has_input else rising[0].level)
    with written_whole(path, force=force) as (part,):
        part.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
