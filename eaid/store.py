"""Results ↔ files: JSON with a schema and no time stamp, so that the same input gives the same bytes."""

import json
import math
from pathlib import Path
from typing import Any

from eaid import __version__
from eaid.errors import DataError
from eaid.files import sha256_of, written_whole


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


def dumps(result: dict[str, Any]) -> str:
    """The bytes of a result file, as text."""
    return json.dumps(jsonable(result), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


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


def read_json(path: Path, kind: str) -> dict[str, Any]:
    """Read a result of schema `eaid/{kind}/1`; anything else is refused in one sentence.

    A file of the user's own script may leave the schema out where a part of the kind is in it.
    """
    wanted = f"eaid/{kind}/1"
    if not path.is_file():
        raise DataError(f"{path}: no such file; give the {kind}.json that eaid wrote")
    try:
        result = json.loads(path.read_text(encoding="utf-8"), parse_constant=_not_json, parse_float=_finite)
    except (ValueError, RecursionError) as fault:  # no UTF-8, no JSON, or numbers and nesting beyond all reason
        raise DataError(f"{path}: is not a JSON file ({fault}); give the {kind}.json that eaid wrote") from None
    found = result.get("schema") if isinstance(result, dict) else None
    of_a_script = isinstance(result, dict) and "schema" not in result and any(part in result for part in SHAPES[kind])
    if found != wanted and not of_a_script:
        said = f"its schema is {found!r}" if isinstance(found, str) else "it holds no schema"
        raise DataError(f"{path}: is no {wanted} file ({said}); make it again with this version of eaid")
    _check_shapes(path, dict(result), SHAPES[kind])
    return dict(result)


SHAPES: dict[str, dict[str, dict[str, int | type]]] = {
    "fit": {
        "data": {"levels": list, "sources": list, "apparatus": dict},
        "friction": {"levels": list, "trends": dict},
        "nonlinear": {"C": 1, "tau1": 3, "tau2": 3, "Ts": 4, "u_range": 2, "per_level": list},
        "linear": {"a0": 1, "b0": 1, "c0": 1, "per_level": list, "bounds": dict},
        "release": {},
    },
    "gains": {"model": {"a0": 1, "b0": 1, "c0": 1}, "rc": {"K_P": 1, "K_D": 1}, "pi": {"K_P": 1, "K_I": 1}},
}
"""What the parts of a result are, where they are there: so many numbers, a list, or an object (a dict)."""
_WORDS: dict[type, str] = {list: "a list", dict: "an object"}


def _check_shapes(path: Path, result: dict[str, Any], shapes: dict[str, dict[str, int | type]]) -> None:
    """Refuse a result whose parts are not what they should be; those absent or empty are left to their users."""
    for part, keys in shapes.items():
        inside = result.get(part)
        if not inside and inside is not False and inside != 0:
            continue
        if not isinstance(inside, dict):
            raise DataError(f"{path}: its {part} is {_short(inside)}, not an object; make it again with eaid")
        for key, wanted in keys.items():
            if key not in inside:
                continue
            value = inside[key]
            if isinstance(wanted, type):
                fits, what = isinstance(value, wanted) or value is None, _WORDS[wanted]
            else:
                numbers = value if wanted > 1 and isinstance(value, list) else [value]
                fits = len(numbers) == wanted and all(
                    isinstance(one, int | float) and not isinstance(one, bool) for one in numbers
                )
                what = "a number" if wanted == 1 else f"a list of {wanted} numbers"
            if not fits:
                raise DataError(f"{path}: its {part}.{key} is {_short(value)}, not {what}; make it again with eaid")


def _short(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 40 else text[:37] + "…"


def input_record(path: Path) -> dict[str, str]:
    """How a result names one of its inputs: the path as given, and its fingerprint."""
    return {"path": str(path), "sha256": sha256_of(path)}
