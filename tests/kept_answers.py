"""Answers that were kept, against those of today: what the tests of two rooms share."""

from typing import Any


def differing(now: list[Any], kept: list[Any], share: float, least: float) -> list[int]:
    """Places at which answers differ, numbers by more than a share of themselves and more than `least`."""
    assert len(now) == len(kept)
    return [k for k, pair in enumerate(zip(now, kept, strict=True)) if not _alike(*pair, share, least)]


def _alike(now: Any, kept: Any, share: float, least: float) -> bool:
    if isinstance(now, list) and isinstance(kept, list):
        return len(now) == len(kept) and all(_alike(a, b, share, least) for a, b in zip(now, kept, strict=True))
    if isinstance(now, float | int) and isinstance(kept, float | int):
        return abs(now - kept) <= share * max(abs(now), abs(kept)) + least
    return bool(now == kept)
