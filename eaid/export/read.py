"""The result files that an export is made from."""

import json
from pathlib import Path
from typing import Any

from eaid.errors import DataError
from eaid.files import sha256_of
from eaid.findings import Finding
from eaid.results import codec
from eaid.results.fit import Fit
from eaid.results.gains import Gains


def kind_of(path: Path) -> str:
    """gains or fit, by the schema, else by the parts that a file of a script holds."""
    if not path.is_file():
        raise DataError(f"{path}: no such file; give gains.json of eaid tune-rc, or fit.json of eaid fit")
    content = _content(path)
    schema = content.get("schema")
    if schema in ("eaid/gains/1", "eaid/fit/1"):
        return str(schema).split("/")[1]
    if schema is None and {"rc", "pi"} & content.keys():
        return "gains"
    if schema is None and "nonlinear" in content:
        return "fit"
    raise DataError(f"{path}: is neither gains.json nor fit.json; give what eaid tune-rc or eaid fit wrote")


def _content(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as fault:
        raise DataError(f"{path}: is not a JSON file ({fault}); give what eaid tune-rc or eaid fit wrote") from None
    return content if isinstance(content, dict) else {}


def read_gains(path: Path) -> tuple[Gains, tuple[Finding, ...]]:
    """gains.json as its type, and what was left out of it."""
    return codec.read(path, "gains", Gains)


def read_fit(path: Path) -> tuple[Fit, tuple[Finding, ...]]:
    """fit.json as its type, and what was left out of it; DataError where it holds no nonlinear model."""
    fit, left_out = codec.read(path, "fit", Fit)
    if fit.nonlinear is None:
        raise DataError(f"{path}: holds no nonlinear model, which plant and inverse are; fit clutch data with it")
    return fit, left_out


def fit_beside(gains: Gains, path: Path) -> Path | None:
    """The fit that gains were made from, where its file is still there, unchanged, and holds a plant."""
    named = gains.inputs.fit
    if named is None or not named.sha256:
        return None
    for candidate in (path.parent / named.path, path.parent / Path(named.path).name, Path(named.path)):
        if candidate.is_file() and sha256_of(candidate) == named.sha256:
            return candidate if _content(candidate).get("nonlinear") else None
    return None
