"""Every answer of `eaid.logs` to the made logs of `answers.py` is that of answers.json."""

import json
import sys
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from answers import FAMILIES, FILE, answers

KEPT = json.loads(FILE.read_text(encoding="utf-8"))


def alike(now: Any, kept: Any) -> bool:
    """Equal, numbers to two in the last of seven digits."""
    if isinstance(now, list) and isinstance(kept, list):
        return len(now) == len(kept) and all(map(alike, now, kept))
    if isinstance(now, float | int) and isinstance(kept, float | int):
        return abs(now - kept) <= 2e-6 * max(abs(now), abs(kept)) + 1e-12
    return bool(now == kept)


@pytest.mark.parametrize("family", FAMILIES)
def test_answers(family: str) -> None:
    now = answers(family)
    assert len(now) == len(KEPT[family])
    changed = [k for k, (one, kept) in enumerate(zip(now, KEPT[family], strict=True)) if not alike(one, kept)]
    assert not changed, f"{family} {changed}: first now {now[changed[0]]}, kept {KEPT[family][changed[0]]}"
