"""The robust and the bootstrap intervals agree on the shipped sets, as far as 100 refits can tell."""

from typing import Any

import numpy as np
import pytest

import eaid
from eaid.synth.datasets import shipped


def log_widths(rows: Any, name: str) -> np.ndarray:
    """Logs of high over low; NaN where an interval says nothing and is left out."""
    ends = [getattr(row.ci95, name) for row in rows]
    return np.array([np.nan if one is None else np.diff(np.log(one))[0] for one in ends])


def both(kind: str) -> Any:
    stepset = eaid.read(shipped()[kind])
    return eaid.fit(stepset, estimator="joint"), eaid.fit(stepset, ci="bootstrap", draws=100, estimator="joint")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["friction-force", "friction-speed"])
def test_two_ways_agree(kind: str) -> None:
    agree_at_levels(*both(kind))


def agree_at_levels(ours: Any, other: Any) -> None:
    """A standard deviation from 100 refits is known to 7 %, that of a few runs of a level to 30 %."""
    for name in ("Ts", "tau1", "tau2"):
        ratio = log_widths(other.friction.levels, name) / log_widths(ours.friction.levels, name)
        assert np.median(ratio) == pytest.approx(1, abs=0.12), name
        assert np.abs(np.log(ratio)).max() < np.log(1.3), name
