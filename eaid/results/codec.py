"""Typed results ↔ JSON files, with a digest, a schema and no time stamp: the same input gives the same bytes.

Writing: a part that is absent is left out, a number that is not known is null, and findings get their sentences
(`text`; the texts of a part's findings again as its `warnings`). Reading: every value is held against the type of its
key. A value of another type is refused by name; a part that lacks what it needs is left out, with a finding, and costs
the features that need it; keys that no type names are passed over.
"""

import copy
import hashlib
import json
import math
import os
import re
import typing
from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from functools import cache, reduce
from operator import getitem
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import msgspec

from eaid.errors import DataError, UsageError
from eaid.files import written_whole
from eaid.findings import Finding, finding, sentences
from eaid.results.common import Samples
from eaid.shown import Shown, pandas
from eaid.version import __version__

R = TypeVar("R", bound=msgspec.Struct)
VERSIONS = {"fit": 2}  # Schema versions above the first; a file of an older one is refused by name
RESULT_KINDS: dict[str, tuple[str, ...]] = {
    "fit": ("data", "friction", "nonlinear", "linear", "release"),
    "gains": ("model", "rc", "pi"),
    "couple": (),
    "plan": (),
    "rig": (),
    "compare": (),
}
"""Kind of a JSON result → parts by which a file that names no schema is known."""


def schema_of(kind: str) -> str:
    """The schema that files of a kind name."""
    return f"eaid/{kind}/{VERSIONS.get(kind, 1)}"


def to_plain(value: Any) -> Any:
    """A result as JSON has it: structs and dataclasses to objects under their keys, what is not finite to null."""
    if isinstance(value, Finding):
        return {**msgspec.to_builtins(value), "values": to_plain(value.values), "text": sentences([value])[0]}
    if isinstance(value, msgspec.Struct):
        kept = {}
        for name, key in zip(value.__struct_fields__, value.__struct_encode_fields__, strict=True):
            item = getattr(value, name)
            if not isinstance(item, Samples) and (item is not None or name not in result_fields(type(value))):
                kept[key] = to_plain(item)
        return kept
    if isinstance(value, Mapping):
        return {str(key): to_plain(item) for key, item in value.items()}
    if is_dataclass(value):
        return {one.name.rstrip("_"): to_plain(getattr(value, one.name)) for one in fields(value)}
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, list | tuple):
        return [to_plain(item) for item in value]
    if hasattr(value, "tolist"):
        return to_plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def content_of(result: object, kind: str) -> dict[str, Any]:
    """The content of a result file: schema, version, the result, and the older `warnings` as texts."""
    content: dict[str, Any] = {"schema": schema_of(kind), "eaid": __version__, **to_plain(result)}
    found: tuple[Finding, ...] = getattr(result, "findings", ())
    parts = [name for name in RESULT_KINDS[kind] if isinstance(content.get(name), dict)] if kind == "fit" else []
    for name in parts:
        content[name]["warnings"] = sentences(one for one in found if one.subject == name)
    content["warnings"] = sentences(one for one in found if one.subject not in parts)
    return content


def dumps(result: object, kind: str = "") -> str:
    """The text of a result file, its digest behind the version; of what no file holds, and has no kind, the content."""
    kind = kind or getattr(result, "FILE", "")
    plain = content_of(result, kind) if kind else to_plain(result)
    if "schema" in plain:
        heading = {key: plain[key] for key in ("schema", "eaid") if key in plain}
        plain = {**heading, "digest": digest_of(plain), **plain}
    return json.dumps(plain, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


class Saved(Shown):
    """A result that has a JSON file of its kind."""

    __slots__ = ()
    FILE: ClassVar[str]
    """fit, gains, couple or plan."""

    def to_dict(self) -> dict[str, Any]:
        """What the file holds."""
        return json.loads(dumps(self))  # type: ignore[no-any-return]

    def save(self, path: str | os.PathLike[str], force: bool = False) -> None:
        """Write the result's JSON file, whole or not at all; an existing file is left alone unless `force`."""
        with written_whole(Path(path), force=force) as (part,):
            part.write_text(dumps(self), encoding="utf-8", errors="surrogatepass")


def kind_of_file(path: Path) -> str:
    """fit, gains, couple or plan, by the schema of a JSON result, else by the parts that a script's own file holds."""
    return _kind_of_content(path, _content(path, "a result that eaid wrote")[1])


def _content(path: Path, wanted: str) -> tuple[str, Any]:
    """Text and content of a JSON file."""
    try:
        text = path.read_text(encoding="utf-8")
        return text, json.loads(text, parse_constant=_finite, parse_float=_finite)
    except (ValueError, RecursionError) as fault:  # no UTF-8, no JSON, or numbers and nesting beyond all reason
        why = "it is binary" if isinstance(fault, UnicodeDecodeError) else fault
        raise DataError(f"{path}: is not a JSON file ({why}); give {wanted}") from None


def _kind_of_content(path: Path, content: Any) -> str:
    schema = content.get("schema") if isinstance(content, dict) else ""
    for kind, parts in RESULT_KINDS.items():
        if schema == schema_of(kind) or (schema is None and any(part in content for part in parts)):
            return kind
        if isinstance(schema, str) and schema.startswith(f"eaid/{kind}/"):
            raise DataError(f"{path}: is an {schema} file; make it again with this version of eaid")
    raise DataError(f"{path}: is no result of eaid; give a fit.json, gains.json or couple.json")


def digest_of(content: dict[str, Any]) -> str:
    """SHA-256 over the canonical JSON (keys in order, no spaces) of a file's content without its digest, in hex."""
    kept = {key: value for key, value in content.items() if key != "digest"}
    text = json.dumps(kept, ensure_ascii=False, allow_nan=False, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode("utf-8", errors="surrogatepass")).hexdigest()


def read_as(path: Path, type_: type[R]) -> tuple[R, tuple[Finding, ...]]:
    """A result file as its type, and what was left out or changed, as findings; DataError where it is no such file."""
    kind: str = type_.FILE  # type: ignore[attr-defined]
    wanted = f"the {kind}.json that eaid wrote"
    if path.is_dir():
        raise DataError(f"{path}: is a folder; give {wanted}, of logs what eaid fit makes of them")
    if not path.is_file():
        raise DataError(f"{path}: no such file; give {wanted}")
    text, content = _content(path, wanted)
    if _kind_of_content(path, content) != kind:
        said = f"its schema is {content['schema']!r}" if "schema" in content else "it holds no schema"
        raise DataError(f"{path}: is no {kind} of eaid ({said}); give {wanted}")
    found: list[Finding] = []
    if "digest" in content and content["digest"] != digest_of(content):
        if text.startswith('{\n "schema"') and text.endswith("\n}\n"):
            raise DataError(
                f"{path}: is damaged, or was changed after eaid wrote it; make it again with eaid, "
                "or delete its line digest if the change is yours"
            )
        found.append(finding("result-written-anew", str(path)))
    return from_plain(content, type_, str(path), found), tuple(found)


def from_plain(content: Any, type_: type[R], source: str, found: list[Finding] | None = None) -> R:
    """Plain content as its type; `found` gets a finding for each part that is left out."""
    kept = copy.deepcopy(content)
    while True:
        try:
            return msgspec.convert(kept, type_, strict=True)
        except msgspec.ValidationError as fault:
            what, _, where = str(fault).partition(" - at `$")
            where = where.removesuffix("`").removeprefix(".")
            missing = re.fullmatch("Object missing required field `(.*)`", what)
            if not _left_out(kept, where, what):
                why = f"its {where or 'content'} has no {missing[1]}" if missing else _sentence(what, where, kept)
                raise DataError(f"{source}: {why}; make it again with eaid") from None
            if missing and found is not None:
                found.append(finding("part-left-out", source, part=where, key=missing[1]))
        except UsageError as fault:
            raise DataError(*(f"{source}: its options say {each}" for each in fault.sentences)) from None


def _left_out(content: Any, where: str, fault: str) -> bool:
    """Take out what a fault is about, where it is as good as absent: null, empty, or a part that lacks a value. False
    where it is another fault, the content itself, or one of a list of numbers, whose others would move up."""
    keys = _keys(where.partition("[...]")[0])  # entries of a mapping are left out with it
    lacks = fault.startswith("Object missing")
    try:
        content = reduce(getitem, keys[:-1], content)
        value = content[keys[-1]]
        empty = value is None or (value in ("", [], {}) and re.match("Expected `(object|array)", fault) is not None)
        if not (lacks or (empty and isinstance(content, dict))):
            return False
        del content[keys[-1]]
    except (KeyError, IndexError, TypeError):
        return False
    return True


def _keys(where: str) -> list[str | int]:
    """`levels[0].Ts` as keys."""
    return [int(key) if key.isdigit() else key for key in re.findall(r"[^.\[\]]+", where)]


def _holds_struct(hint: Any) -> bool:
    """Whether a type is a struct, or has one inside."""
    is_struct = isinstance(hint, type) and issubclass(hint, msgspec.Struct)
    return is_struct or any(map(_holds_struct, typing.get_args(hint)))


@cache
def result_fields(type_: type) -> frozenset[str]:
    """The fields of a result that hold results of their own."""
    return frozenset(name for name, hint in typing.get_type_hints(type_).items() if _holds_struct(hint))


def _sentence(what: str, where: str, content: Any) -> str:
    """What is wrong with a value, by the name of its key."""
    reason = what.replace("`", "")
    try:
        text = json.dumps(reduce(getitem, _keys(where), content), ensure_ascii=False)
    except (KeyError, IndexError, TypeError):
        return f"its {where} is wrong ({reason})"
    return f"its {where or 'content'} is {text if len(text) <= 40 else text[:37] + '…'} ({reason})"


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"it holds {text[:20]}, which is no finite number")
    return value


def cells_of(item: msgspec.Struct) -> dict[str, Any]:
    """The fields of a result that are no parts of their own, by their keys; of intervals `ci95` both ends."""
    cells: dict[str, Any] = {}
    for name, key in zip(item.__struct_fields__, item.__struct_encode_fields__, strict=True):
        value = getattr(item, name)
        if name in result_fields(type(item)):
            ends = value.__struct_fields__ if name == "ci95" and value is not None else ()
            for one in (each for each in ends if each != "dof"):
                low, high = getattr(value, one) or (math.nan, math.nan)
                cells |= {f"{one}_low": low, f"{one}_high": high}
        elif value is None or isinstance(value, float | int | str | bool):
            cells[key] = math.nan if value is None else value
    return cells


def frame_of(items: Iterable[msgspec.Struct]) -> "pandas.DataFrame":
    """One row a result, one column a field."""
    return pandas.DataFrame([cells_of(item) for item in items])
