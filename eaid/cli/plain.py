"""Arguments of the plain kinds (text, number, path, lists of them) made into values without pydantic.

Typer from 0.27 on validates every argument by pydantic, whose import and validators take 80 ms of each command. What is
plainly right is taken here; everything else, every wrong value among it, goes the way of Typer, so that its sentences
stay the same. With a Typer that has no such validators nothing is changed.
"""

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args, get_origin

from typer.core import TyperCommand, TyperGroup

_WHOLE = re.compile(r"[+-]?\d{1,18}")
_REAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?")
_PLAIN_PATH: dict[str, Any] = {
    "exists": False,
    "file_okay": True,
    "dir_okay": True,
    "writable": False,
    "readable": True,
}
_PLAIN_PATH |= {"resolve_path": False, "allow_dash": False, "path_type": None, "parser": None}


class NotPlainError(Exception):
    """This value is for Typer to judge."""


def _flag(value: Any) -> bool:
    if type(value) is bool:
        return value
    raise NotPlainError


def _text(value: Any) -> str:
    if type(value) is str:
        return value
    raise NotPlainError


def _whole(value: Any) -> int:
    if type(value) is int:
        return value
    if type(value) is str and value.isascii() and _WHOLE.fullmatch(value):
        return int(value)
    raise NotPlainError


def _real(value: Any) -> float:
    if type(value) is float:
        return value
    if type(value) is str and value.isascii() and _REAL.fullmatch(value):
        return float(value)
    raise NotPlainError


def _path(value: Any) -> Path:
    if not isinstance(value, str | Path):
        raise NotPlainError
    try:
        os.stat(value)
    except OSError:
        return Path(value)  # Typer takes a path to nothing, too
    except ValueError:
        raise NotPlainError from None
    if not os.access(value, os.R_OK):
        raise NotPlainError
    return Path(value)


_KINDS: dict[type, Callable[[Any], Any]] = {bool: _flag, str: _text, int: _whole, float: _real, Path: _path}


class Plain:
    """Stands where a parameter of Typer keeps its validator."""

    def __init__(self, param: Any, one: Callable[[Any], Any], listed: bool) -> None:
        self._param, self._one, self._listed = param, one, listed

    def coerce(self, value: Any, param: Any, ctx: Any) -> Any:
        """The value of an argument; by Typer's own validator where it is not plain."""
        try:
            if value is None:
                return () if param.multiple or param.nargs == -1 else None
            if not self._listed:
                return self._one(value)
            if isinstance(value, list | tuple):
                return [self._one(item) for item in value]
        except NotPlainError:
            pass
        self._param._runtime_param = None
        return self._param.get_runtime_param().coerce(value, param=param, ctx=ctx)


def made_plain(param: Any) -> None:
    """Give a parameter of a plain kind its shorter way."""
    if getattr(param, "_runtime_param", 0) is not None:
        return  # another Typer, or done already
    info, kind = param.type_descriptor.parameter_info, param.type_descriptor.annotation
    listed = get_origin(kind) is list
    if listed:
        (kind,) = get_args(kind)
    one = _KINDS.get(kind)
    limits = (info.min, info.max, info.clamp) != (None, None, False)
    if one is None or limits or any(getattr(info, name) != value for name, value in _PLAIN_PATH.items()):
        return
    param._runtime_param = Plain(param, one, listed)


class _MadePlain:
    """What a command of Typer needs besides."""

    def get_params(self, ctx: Any) -> Any:
        """The parameters of the command, `--help` among them, as they are asked for before parsing."""
        params = super().get_params(ctx)  # type: ignore[misc]  # of the class it is mixed with
        for param in params:
            made_plain(param)
        return params


class PlainGroup(_MadePlain, TyperGroup):
    """The commands and the options before them."""


class PlainCommand(_MadePlain, TyperCommand):
    """One command."""
