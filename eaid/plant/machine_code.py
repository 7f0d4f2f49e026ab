"""Functions in machine code, by numba, kept on disk where there is a folder that it may write to.

numba keeps code in a file of the function's name and looks at the date of that function's own module: what it calls, or
the types that it takes, may be of another version. So the name has a fingerprint of all sources, and what another
version left is never opened.
"""

import hashlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function, files: Iterable[Path], **options: Any) -> Function:
    """The function in machine code that is made anew where any of its source `files` changes."""
    sources = hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()
    function.__qualname__ += f"_{sources[:16]}"
    try:
        return numba.njit(error_model="numpy", cache=True, **options)(function)  # type: ignore[no-any-return]
    except RuntimeError:  # no folder that it may write to
        return numba.njit(error_model="numpy", **options)(function)  # type: ignore[no-any-return]


def machine_code(**options: Any) -> Callable[[Function], Function]:
    """`compiled` of what is made of this room alone, as a decorator."""
    room = sorted(Path(__file__).parent.glob("*.py"))
    return lambda function: compiled(function, room, **options)
