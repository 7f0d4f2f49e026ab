"""The one place that loads a module when it is first asked for: what a command does not need costs it nothing."""

from importlib import import_module
from typing import Any


def late(module: str, name: str, *default: object) -> Any:
    """A name of a module; `default` where the module has none of that name."""
    return getattr(import_module(module), name, *default)
