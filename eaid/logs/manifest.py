"""`dataset.toml`: all that is to be said about a folder of logs, said once.

`eaid ingest --write-manifest` writes it beside the logs from what was found; where a folder holds one, or one is given
as a log, its options and its list of logs stand in for those of the command line.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eaid.errors import DataError, UsageError
from eaid.files import sha256_of, written_whole
from eaid.findings import finding
from eaid.logs.run import Run

NAME = "dataset.toml"
SCHEMA = "eaid/manifest/1"
OPTIONS: dict[str, type] = {
    "kind": str, "columns": str, "units": str, "name_pattern": str, "step_at": float, "until": float, "repair": bool,
    "levels": str, "baseline": str, "sign": str, "variable": str, "rate_hz": float, "rest": float, "apparatus": str,
    "join": bool,
}  # fmt: skip
"""Options of the command line that a manifest may hold, under the same names."""


@dataclass(frozen=True)
class Entry:
    """One log of a manifest."""

    path: Path
    sha256: str | None = None
    level: float | None = None
    """For logs without an input column."""
    repeat: int | None = None
    step_s: float | None = None
    until_s: float | None = None


@dataclass(frozen=True)
class Manifest:
    """Options and logs of a folder."""

    path: Path
    options: Mapping[str, Any]
    logs: tuple[Entry, ...]

    def unlisted(self) -> list[str]:
        """Names of the logs beside the manifest that it does not list."""
        from eaid.logs.folders import files_of

        listed = {entry.path.resolve() for entry in self.logs}
        return [file.name for file in files_of([self.path.parent]) if file.resolve() not in listed]


def manifest_of(paths: Sequence[Path]) -> Manifest | None:
    """The manifest that is meant: given itself, or lying in the one folder that is given; None where there is none."""
    found = [path / NAME for path in paths if (path / NAME).is_file()]
    found += [path for path in paths if path.suffix == ".toml" and path.is_file()]
    if not found:
        return None
    if len(paths) > 1:
        raise UsageError(f"{found[0]}: says all about its own logs; give it, or its folder, alone")
    return read_manifest(found[0])


def read_manifest(path: Path) -> Manifest:
    """A manifest; raises DataError where it is not written as this eaid writes it."""
    import tomllib

    try:
        content = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as fault:
        raise DataError(f"{path}: is no TOML ({fault}); write it again with eaid ingest --write-manifest") from None
    if content.get("schema") != SCHEMA:
        raise DataError(
            f"{path}: its schema is {content.get('schema')!r}, and this eaid reads {SCHEMA!r}; write it again"
        )
    options = content.get("options", {})
    entries = content.get("log", [])
    if not isinstance(options, dict) or not isinstance(entries, list) or not entries:
        raise DataError(f"{path}: lists no logs; write it again with eaid ingest --write-manifest")
    for name, value in options.items():
        kind = OPTIONS.get(name)
        if kind is None:
            raise DataError(f"{path}: knows no option {name}; it may hold {', '.join(OPTIONS)}")
        if not isinstance(value, (int, float) if kind is float else kind) or (
            kind is float and isinstance(value, bool)
        ):
            raise DataError(f"{path}: its option {name} is {value!r}; it must be {_WORDS[kind]}")
    logs = tuple(_entry(path, i, entry) for i, entry in enumerate(entries, start=1))
    missing = [f"{path}: its log {entry.path.name} is not there; put it back or take it off" for entry in logs
               if not entry.path.is_file()]  # fmt: skip
    if missing:
        raise DataError(*missing)
    return Manifest(path, options, logs)


_WORDS = {str: "a text", float: "a number", bool: "true or false"}


def _entry(path: Path, number: int, entry: Any) -> Entry:
    if not isinstance(entry, dict) or not isinstance(entry.get("file"), str):
        raise DataError(f"{path}: its log {number} names no file; write it again with eaid ingest --write-manifest")
    unknown = set(entry) - {"file", "sha256", "level", "repeat", "step_s", "until_s"}
    if unknown:
        raise DataError(f"{path}: its log {entry['file']} holds {min(unknown)}, which means nothing; take it off")
    numbers = {key: entry[key] for key in ("level", "repeat", "step_s", "until_s") if key in entry}
    for key, value in numbers.items():
        if isinstance(value, bool) or not isinstance(value, int if key == "repeat" else (int, float)):
            raise DataError(f"{path}: the {key} of its log {entry['file']} is {value!r}; it must be a number")
    return Entry(path.parent / entry["file"], entry.get("sha256"), **numbers)


def apply(entry: Entry, run: Run) -> Run:
    """A run with what the manifest says of its log where the log does not say it itself."""
    from dataclasses import replace

    changed: dict[str, Any] = {}
    if entry.sha256 and run.sha256 != entry.sha256:
        changed["findings"] = (*run.findings, finding("log-changed", run.name))
    if run.input.size and run.input[0] != run.input[0] and entry.level is not None:  # NaN: no input column
        changed["level"] = entry.level
    instants = {"step_s": entry.step_s, "until_s": entry.until_s}
    said = {"repeat": entry.repeat, **{k: None if at is None else at - run.start_s for k, at in instants.items()}}
    if not run.cut:
        changed |= {name: value for name, value in said.items() if value is not None}
    return replace(run, **changed)


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    return json.dumps(value, ensure_ascii=False)


def write_manifest(files: Sequence[Path], runs: Sequence[Run], options: Mapping[str, Any], force: bool = False) -> Path:
    """Write `dataset.toml` beside the logs from what was found in them; returns its path.

    `runs` are cut; `options` as given on the command line. Raises UsageError where the logs lie in several folders.
    """
    folders = {file.resolve().parent for file in files}
    if len(folders) != 1:
        raise UsageError("--write-manifest: the logs lie in several folders; put them into one")
    path = files[0].parent / NAME
    lines = [f"schema = {_toml(SCHEMA)}", "", "[options]"]
    lines += [
        f"{name} = {_toml(value)}" for name, value in options.items() if name in OPTIONS and value not in (None, False)
    ]
    rising: dict[str, Run] = {}
    for run in runs:
        if run.edge == "rising" and run.from_level == 0:
            rising.setdefault(run.source, run)
    for file in files:
        lines += ["", "[[log]]", f"file = {_toml(file.name)}", f"sha256 = {_toml(sha256_of(file))}"]
        found = rising.get(str(file))
        several = sum(run.source == str(file) and run.edge == "rising" for run in runs) > 1
        if found is not None and not several and not found.dataset:
            lines.append(f"repeat = {found.repeat}")
            if found.input.size and found.input[0] != found.input[0]:
                lines.append(f"level = {_toml(found.level)}")  # its instant is found anew: it may be wrong
    with written_whole(path, force) as part:
        part.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
