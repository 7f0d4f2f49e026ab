"""Typed results ↔ JSON files, with a digest, a schema and no time stamp: the same input gives the same bytes.

Writing: a part that is absent is left out, a number that is not known is null, and findings get their sentences
(`text`; the texts of a part's findings again as its `warnings`). Reading: every value is held against the type of its
key. A value of another type is refused by name; a part that lacks what it needs is left out, with a finding, and costs
the features that need it; keys that no type names are passed over.
"""

import hashlib
import json
import math
import os
import re
import types
import typing
from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import msgspec

from eaid.errors import DataError, UsageError
from eaid.files import written_whole
from eaid.findings import Finding, finding, sentences
from eaid.shown import Shown
from eaid.version import __version__

if TYPE_CHECKING:
    import pandas

R = TypeVar("R", bound=msgspec.Struct)
VERSIONS = {"fit": 2}
"""Schema versions above the first; a file of an older one is refused by name."""
KINDS: dict[str, tuple[str, ...]] = {
    "fit": ("data", "friction", "nonlinear", "linear", "release"),
    "gains": ("model", "rc", "pi"),
    "couple": (),
    "plan": (),
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
            if item is not None or not holds_part(type(value), name):
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
    parts = [name for name in KINDS[kind] if isinstance(content.get(name), dict)] if kind == "fit" else []
    for name in parts:
        content[name]["warnings"] = sentences(one for one in found if one.subject == name)
    content["warnings"] = sentences(one for one in found if one.subject not in parts)
    return content


def text_of(content: Mapping[str, Any]) -> str:
    """The text of plain content; one with a schema gets its digest behind the version."""
    plain = to_plain(content)
    if "schema" in plain:
        heading = {key: plain[key] for key in ("schema", "eaid") if key in plain}
        plain = {**heading, "digest": digest_of(plain), **plain}
    return json.dumps(plain, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def dumps(result: object, kind: str = "") -> str:
    """The text of a result file; of what no file holds, and has no kind, the content alone."""
    kind = kind or getattr(result, "FILE", "")
    return text_of(content_of(result, kind) if kind else to_plain(result))


class Saved(Shown):
    """A result that has a JSON file of its kind."""

    __slots__ = ()
    FILE: ClassVar[str]
    """fit, gains, couple or plan."""

    def save(self, path: str | os.PathLike[str], force: bool = False) -> None:
        """Write the result's JSON file, whole or not at all; an existing file is left alone unless `force`."""
        with written_whole(Path(path), force) as part:
            part.write_text(dumps(self), encoding="utf-8", errors="surrogatepass")


def kind_of(path: Path) -> str:
    """fit, gains or couple, by the schema of a JSON result, else by the parts that a script's own file holds."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as fault:
        raise DataError(f"{path}: is not a JSON file ({fault}); give a result that eaid wrote") from None
    schema = content.get("schema") if isinstance(content, dict) else ""
    for kind, parts in KINDS.items():
        if schema == schema_of(kind) or (schema is None and any(part in content for part in parts)):
            return kind
    refuse_other_version(path, schema)
    raise DataError(f"{path}: is no result of eaid; give a fit.json, gains.json or couple.json")


def refuse_other_version(path: Path, schema: object) -> None:
    """Raise DataError where a file names a schema of a known kind, but of another version."""
    kind = schema.split("/")[1] if isinstance(schema, str) and schema.count("/") == 2 else ""
    if kind in KINDS and schema != schema_of(kind):
        raise DataError(f"{path}: is an {schema} file; make it again with this version of eaid")


def digest_of(content: dict[str, Any]) -> str:
    """SHA-256 over the canonical JSON (keys in order, no spaces) of a file's content without its digest, in hex."""
    kept = {key: value for key, value in content.items() if key != "digest"}
    text = json.dumps(kept, ensure_ascii=False, allow_nan=False, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode("utf-8", errors="surrogatepass")).hexdigest()


def read(path: Path, type_: type[R]) -> tuple[R, tuple[Finding, ...]]:
    """A result file as its type, and what was left out or changed, as findings; DataError where it is no such file."""
    kind: str = type_.FILE  # type: ignore[attr-defined]
    if not path.is_file():
        raise DataError(f"{path}: no such file; give the {kind}.json that eaid wrote")
    try:
        text = path.read_text(encoding="utf-8")
        content = json.loads(text, parse_constant=_not_json, parse_float=_finite)
    except (ValueError, RecursionError) as fault:  # no UTF-8, no JSON, or numbers and nesting beyond all reason
        raise DataError(f"{path}: is not a JSON file ({fault}); give the {kind}.json that eaid wrote") from None
    schema = content.get("schema") if isinstance(content, dict) else None
    of_a_script = isinstance(content, dict) and "schema" not in content and any(part in content for part in KINDS[kind])
    if schema != schema_of(kind) and not of_a_script:
        said = f"its schema is {schema!r}" if isinstance(schema, str) else "it holds no schema"
        if isinstance(schema, str) and schema.startswith(f"eaid/{kind}/"):
            refuse_other_version(path, schema)
        raise DataError(f"{path}: is no {kind} of eaid ({said}); give the {kind}.json that eaid wrote")
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
    found = [] if found is None else found
    try:
        kept = _whole(content, type_, "", source, found)
        return msgspec.convert(kept, type_, strict=True)
    except _MissingError as fault:
        raise DataError(f"{source}: its {fault.where} has no {fault.key}; make it again with eaid") from None
    except msgspec.ValidationError as fault:
        raise DataError(f"{source}: {_sentence(fault, content)}; make it again with eaid") from None
    except UsageError as fault:
        raise DataError(*(f"{source}: its options say {each}" for each in fault.sentences)) from None


class _MissingError(Exception):
    """A part lacks a value without which it says nothing."""

    def __init__(self, where: str, key: str) -> None:
        self.where, self.key = where or "content", key


def _whole(value: Any, type_: Any, where: str, source: str, found: list[Finding]) -> Any:
    """The value without optional parts that lack what they need."""
    part = _struct_in(type_)
    if part is None or value is None:
        return value
    origin, arguments = typing.get_origin(type_), typing.get_args(type_)
    if origin is tuple and isinstance(value, list):
        pairs = [(f"{where}[{i}]", item) for i, item in enumerate(value)]
        return [item for name, one in pairs if (item := _optional(one, arguments[0], name, source, found)) is not None]
    if origin is dict and isinstance(value, dict):
        items = {k: _optional(one, arguments[1], f"{where}.{k}", source, found) for k, one in value.items()}
        return {key: item for key, item in items.items() if item is not None}
    if origin in (typing.Union, types.UnionType):
        return _optional(value, next(a for a in arguments if _struct_in(a)), where, source, found)
    if isinstance(value, dict) and isinstance(type_, type):
        return _fields(value, type_, where, source, found)
    return value


def _fields(value: dict[str, Any], type_: type, where: str, source: str, found: list[Finding]) -> dict[str, Any]:
    kept = dict(value)
    hints = _hints(type_)
    for field in msgspec.structs.fields(type_):
        key, inside = field.encode_name, f"{where}.{field.encode_name}".lstrip(".")
        if key in kept:
            kept[key] = _whole(kept[key], hints[field.name], inside, source, found)
            optional = type(None) in typing.get_args(hints[field.name])
            if (kept[key] is None and not optional) or (kept[key] in ("", []) and _struct_in(hints[field.name])):
                del kept[key]
        if field.required and key not in kept:
            raise _MissingError(where, key)
    return kept


def _optional(value: Any, type_: Any, where: str, source: str, found: list[Finding]) -> Any:
    if value in ("", [], {}):
        return None  # empty is as good as absent
    try:
        return _whole(value, type_, where, source, found)
    except _MissingError as fault:
        found.append(finding("part-left-out", source, part=fault.where, key=fault.key))
        return None


@cache
def _hints(type_: type) -> dict[str, Any]:
    return typing.get_type_hints(type_)


def _struct_in(hint: Any) -> Any:
    """The first struct type inside a type, None where there is none."""
    if isinstance(hint, type) and issubclass(hint, msgspec.Struct):
        return hint
    return next((one for argument in typing.get_args(hint) if (one := _struct_in(argument)) is not None), None)


@cache
def holds_part(type_: type, name: str) -> bool:
    """Whether a field of a result holds results of its own."""
    return _struct_in(_hints(type_)[name]) is not None


_FAULT = re.compile(r"(?P<what>.*?)(?: - at `\$\.?(?P<where>.*)`)?")


def _sentence(fault: msgspec.ValidationError, content: Any) -> str:
    """What is wrong with a value, by the name of its key."""
    found = _FAULT.fullmatch(str(fault))
    what, where = (found["what"], found["where"] or "") if found else (str(fault), "")
    value = content
    for key in re.findall(r"[^.\[\]]+", where):
        try:
            value = value[int(key)] if isinstance(value, list) else value[key]
        except (KeyError, IndexError, TypeError, ValueError):
            return f"its {where} is wrong ({what.replace('`', '')})"
    text = json.dumps(value, ensure_ascii=False)
    return f"its {where or 'content'} is {text if len(text) <= 40 else text[:37] + '…'} ({what.replace('`', '')})"


def _not_json(word: str) -> float:
    raise ValueError(f"it holds {word}, which is no JSON number")


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
        if holds_part(type(item), name):
            ends = value.__struct_fields__ if name == "ci95" and value is not None else ()
            for one in (each for each in ends if each != "dof"):
                low, high = getattr(value, one) or (math.nan, math.nan)
                cells |= {f"{one}_low": low, f"{one}_high": high}
        elif value is None or isinstance(value, float | int | str | bool):
            cells[key] = math.nan if value is None else value
    return cells


def frame_of(items: Iterable[msgspec.Struct]) -> "pandas.DataFrame":
    """One row a result, one column a field."""
    import pandas

    return pandas.DataFrame([cells_of(item) for item in items])
