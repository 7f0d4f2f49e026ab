"""Every answer of the fits to the made sets of `fit_answers.py` is that of answers.json."""

import json
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))
from fit_answers import FITS, FITTING, differences, of_fitting

KEPT = json.loads(FITTING.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", FITS)
def test_answers(name: str) -> None:
    changed = differences(of_fitting(name), KEPT[name])
    assert not changed, f"{len(changed)} numbers, first {changed[:3]}; if that is meant: python tests/fit_answers.py"
