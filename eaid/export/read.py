"""The result files that an export is made from."""

import json
from pathlib import Path

from eaid.errors import DataError
from eaid.files import sha256_of
from eaid.findings import Finding
from eaid.results import codec
from eaid.results.fit import Fit
from eaid.results.gains import Gains

MAKE = "give what eaid tune-rc or eaid fit wrote"
PARTS = {"gains": ("rc", "pi"), "fit": ("nonlinear",)}
"""Parts by which the file of a script is known, which names no schema."""


def kind_of(path: Path) -> str:
    """gains or fit, by the schema, else by the parts that a file of a script holds."""
    if not path.is_file():
        raise DataError(f"{path}: no such file; give gains.json of eaid tune-rc, or fit.json of eaid fit")
    try:
        content = json.loads(path.read_bytes())
    except (ValueError, RecursionError) as fault:
        raise DataError(f"{path}: is not a JSON file ({fault}); {MAKE}") from None
    held = content if isinstance(content, dict) else {}
    schema = held.get("schema")
    for kind, parts in PARTS.items():
        if schema == f"eaid/{kind}/1" or (schema is None and any(held.get(part) is not None for part in parts)):
            return kind
    raise DataError(f"{path}: is neither gains.json nor fit.json; {MAKE}")


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
            return candidate if codec.read(candidate, "fit", Fit)[0].nonlinear is not None else None
    return None
