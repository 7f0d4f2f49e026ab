"""Results ↔ files: JSON with a schema and no time stamp, so that the same input gives the same bytes.

A result carries a digest of its own content: a digit that a disk, a mail or a slip of the hand changed is noticed when
it is read again. A file without a digest, as a user's script writes it, is taken as it is; so is one that another
program wrote out anew with the old digest still in it, which is told: damage does not change a file's layout.
"""

import hashlib
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from eaid.errors import DataError
from eaid.files import sha256_of, written_whole
from eaid.version import __version__


def jsonable(value: Any) -> Any:
    """Arrays to lists, NumPy scalars to Python ones, what is not finite to null (JSON has no NaN)."""
    if isinstance(value, dict):
        return {str(key): jsonable(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [jsonable(item) for item in value]
    if hasattr(value, "tolist"):
        return jsonable(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def digest_of(result: dict[str, Any]) -> str:
    """SHA-256 over the canonical JSON (keys in order, no spaces) of a `jsonable` result without its digest, in hex."""
    content = {key: value for key, value in result.items() if key != "digest"}
    text = json.dumps(content, ensure_ascii=False, allow_nan=False, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode("utf-8", errors="surrogatepass")).hexdigest()


def dumps(result: dict[str, Any]) -> str:
    """The bytes of a result file, as text; a result with a schema gets its digest behind the version."""
    result = jsonable(result)
    if "schema" in result:
        heading: dict[str, Any] = {key: result[key] for key in ("schema", "eaid") if key in result}
        result = {**heading, "digest": digest_of(result), **{k: v for k, v in result.items() if k != "digest"}}
    return json.dumps(result, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def stamped(schema: str, result: dict[str, Any]) -> dict[str, Any]:
    """A result headed by its schema and the version that made it."""
    return {"schema": schema, "eaid": __version__, **result}


def write_json(path: Path, result: dict[str, Any], force: bool = False) -> None:
    """Write a result whole or not at all."""
    with written_whole(path, force) as part:
        part.write_text(dumps(result), encoding="utf-8")


def _not_json(word: str) -> float:
    raise ValueError(f"it holds {word}, which is no JSON number")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"it holds {text[:20]}, which is no finite number")
    return value


def read_json(path: Path, kind: str, tell: Callable[[str], None] = lambda _: None) -> dict[str, Any]:
    """Read a result of schema `eaid/{kind}/1`; anything else is refused in one sentence, and so is a damaged one.

    A file of the user's own script may leave the schema out where a part of the kind is in it. Every value has the
    shape that eaid/schema.py promises; parts that lack what they need are left out, and `tell` gets a sentence of each.
    """
    from eaid.schema import RESULTS
    from eaid.shapes import Misshapen, shaped

    wanted = f"eaid/{kind}/1"
    if not path.is_file():
        raise DataError(f"{path}: no such file; give the {kind}.json that eaid wrote")
    try:
        text = path.read_text(encoding="utf-8")
        result = json.loads(text, parse_constant=_not_json, parse_float=_finite)
    except (ValueError, RecursionError) as fault:  # no UTF-8, no JSON, or numbers and nesting beyond all reason
        raise DataError(f"{path}: is not a JSON file ({fault}); give the {kind}.json that eaid wrote") from None
    found = result.get("schema") if isinstance(result, dict) else None
    of_a_script = isinstance(result, dict) and "schema" not in result and any(part in result for part in PARTS[kind])
    if found != wanted and not of_a_script:
        said = f"its schema is {found!r}" if isinstance(found, str) else "it holds no schema"
        raise DataError(f"{path}: is no {wanted} file ({said}); make it again with this version of eaid")
    if "digest" in result and result["digest"] != digest_of(result):
        if text.startswith('{\n "schema"') and text.endswith("\n}\n"):
            raise DataError(
                f"{path}: is damaged, or was changed after eaid wrote it; make it again with eaid, "
                f"or delete its line digest if the change is yours"
            )
        tell(f"{path}: another program has written it anew: its digest no longer fits and is passed over")
    left_out: list[str] = []
    try:
        kept: dict[str, Any] = shaped(result, RESULTS[kind], "", left_out)
    except Misshapen as fault:
        raise DataError(f"{path}: {fault}; make it again with eaid") from None
    for sentence in left_out:
        tell(f"{path}: {sentence}")
    return {key: value for key, value in kept.items() if key != "digest"}


PARTS = {"fit": ("data", "friction", "nonlinear", "linear", "release"), "gains": ("model", "rc", "pi")}
"""Parts by which a file that names no schema is known."""


def input_record(path: Path) -> dict[str, str]:
    """How a result names one of its inputs: the path as given, and its fingerprint."""
    return {"path": str(path), "sha256": sha256_of(path)}
