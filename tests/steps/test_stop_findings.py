"""Stop findings on few logs: `python -m benchmarks.stop_findings` measures the rates on 500 each."""

import pytest

from benchmarks.stop_findings import BAD, false_alarms, misses


def test_good_logs_raise_none() -> None:
    assert sum(false_alarms(60, shapes=False).values()) <= 1


@pytest.mark.parametrize("kind", [kind for kind in BAD if kind != "shape-explains-little"])
def test_bad_logs_are_caught(kind: str) -> None:
    assert misses(kind, 20) <= 2
