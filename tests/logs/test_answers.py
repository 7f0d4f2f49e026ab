"""Every answer of `eaid.logs` to the made logs of `logs_answers.py` is that of answers.json."""

import json
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1]))
from kept_answers import differing
from logs_answers import FAMILIES, FILE, answers

KEPT = json.loads(FILE.read_text(encoding="utf-8"))


@pytest.mark.parametrize("family", FAMILIES)
def test_answers(family: str) -> None:
    now = answers(family)
    changed = differing(now, KEPT[family], 2e-6, 1e-12)
    assert not changed, f"{family} {changed}: first now {now[changed[0]]}, kept {KEPT[family][changed[0]]}"
