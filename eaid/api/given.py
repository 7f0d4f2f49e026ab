"""What every public function may be given: paths in any form, and options whole or one by one."""

import os
from collections.abc import Iterable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

from eaid.errors import UsageError, unknown

K = TypeVar("K")
Paths = str | os.PathLike[str] | Iterable[str | os.PathLike[str]]


def chosen(kind: type[K], options: K | None, keywords: Mapping[str, Any]) -> K:
    """Options given whole, or the defaults, with single ones changed; UsageError for a name that the type lacks."""
    names = getattr(kind, "__struct_fields__", None) or [field.name for field in fields(kind)]  # type: ignore[arg-type]
    for name in keywords:
        if name not in names:
            raise UsageError(unknown("no such option", name, names))
    whole = {} if options is None else {name: getattr(options, name) for name in names}
    return kind(**{**whole, **keywords})


def paths_of(source: Paths) -> list[Path]:
    """One path or several as a list."""
    each = [source] if isinstance(source, str | os.PathLike) else list(source)
    if any(str(one) == "" for one in each):
        raise UsageError("an empty path: give a file or a folder")
    return [Path(one) for one in each]
