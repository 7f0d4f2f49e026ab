"""Numbers that a result file can hold: what is not finite, or beyond any rig, becomes unknown, and is counted."""

from typing import Any, TypeVar

import msgspec

MOST = 1e60
"""Largest size of a number that a result may hold; its cube is still a number."""
R = TypeVar("R", bound=msgspec.Struct)


def quotable(result: R) -> tuple[R, tuple[str, ...]]:
    """The result with unknown numbers as None (an interval with such an end as a whole), and the keys they stood at."""
    found: list[str] = []
    return _kept(result, "", found), tuple(dict.fromkeys(found))


def _kept(value: Any, key: str, found: list[str]) -> Any:
    if isinstance(value, msgspec.Struct):
        changed = {}
        for name in value.__struct_fields__:
            have = getattr(value, name)
            kept = _kept(have, name, found)
            if kept is not have:
                changed[name] = kept
        return msgspec.structs.replace(value, **changed) if changed else value
    if isinstance(value, tuple):
        if len(value) == 2 and all(isinstance(end, float) for end in value):
            if all(_known(end) for end in value):
                return value
            found.append(key)
            return None
        items = [_kept(item, key, found) for item in value]
        return value if all(a is b for a, b in zip(items, value, strict=True)) else tuple(items)
    if isinstance(value, dict):
        entries = {name: _kept(item, key, found) for name, item in value.items()}
        return value if all(entries[name] is value[name] for name in value) else entries
    if isinstance(value, float) and not _known(value):
        found.append(key)
        return None
    return value


def _known(value: float) -> bool:
    return -MOST <= value <= MOST
