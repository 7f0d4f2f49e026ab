from types import ModuleType

import pytest

from benchmarks import coverage


@pytest.fixture(scope="session")
def sets() -> ModuleType:
    """The simulated sets of benchmarks/coverage.py: one_set(seed, variant), truth, hits."""
    return coverage
