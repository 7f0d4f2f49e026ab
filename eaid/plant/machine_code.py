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


def fingerprint(files: Iterable[Path]) -> str:
    """Of what some files hold."""
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:16]


ROOM = fingerprint(sorted(Path(__file__).parent.glob("*.py")))


def compiled(function: Function, sources: str, **options: Any) -> Function:
    """The function in machine code that is made anew where the fingerprint of its `sources` is another."""
    function.__qualname__ += f"_{sources}"
    try:
        return numba.njit(error_model="numpy", cache=True, **options)(function)  # type: ignore[no-any-return]
    except RuntimeError:  # no folder that it may write to
        return numba.njit(error_model="numpy", **options)(function)  # type: ignore[no-any-return]


def machine_code(**options: Any) -> Callable[[Function], Function]:
    """`compiled` of what is made of this room alone, as a decorator."""
    return lambda function: compiled(function, ROOM, **options)
