"""The result files that an export is made from."""

from pathlib import Path

import msgspec

from eaid.errors import DataError
from eaid.files import sha256_of
from eaid.findings import Finding
from eaid.results import codec
from eaid.results.fit import Fit
from eaid.results.gains import Gains

MAKE = "give what eaid tune-rc or eaid fit wrote"

ABSENT = msgspec.Raw(b"null")


class _Parts(msgspec.Struct):
    """What a result file says that it is, and the parts by which one of a script is known."""

    schema: str | None = None
    rc: msgspec.Raw = ABSENT
    pi: msgspec.Raw = ABSENT
    nonlinear: msgspec.Raw = ABSENT


def kind_of(path: Path) -> str:
    """gains or fit, by the schema, else by the parts that a file of a script holds."""
    if not path.is_file():
        raise DataError(f"{path}: no such file; give gains.json of eaid tune-rc, or fit.json of eaid fit")
    parts = _parts(path)
    if parts.schema in ("eaid/gains/1", "eaid/fit/1"):
        return parts.schema.split("/")[1]
    if parts.schema is None and {bytes(parts.rc), bytes(parts.pi)} != {b"null"}:
        return "gains"
    if parts.schema is None and bytes(parts.nonlinear) != b"null":
        return "fit"
    raise DataError(f"{path}: is neither gains.json nor fit.json; {MAKE}")


def _parts(path: Path) -> _Parts:
    try:
        return msgspec.json.decode(path.read_bytes(), type=_Parts)
    except msgspec.ValidationError:
        return _Parts()  # no object, or another's
    except (msgspec.DecodeError, RecursionError) as fault:
        raise DataError(f"{path}: is not a JSON file ({fault}); {MAKE}") from None


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
            return candidate if bytes(_parts(candidate).nonlinear) != b"null" else None
    return None
