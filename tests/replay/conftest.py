"""The reference plant under the published gains."""

from collections.abc import Callable

import pytest

from eaid.control.gains import paper_gains
from eaid.models.parameters import PAPER_LINEAR, REFERENCE_PLANT
from eaid.replay.controllers import CONTROLLERS, Controller, Knowledge
from eaid.replay.plant import PlantParameters, plant_parameters


@pytest.fixture(scope="session")
def plant() -> PlantParameters:
    return plant_parameters(REFERENCE_PLANT)


@pytest.fixture(scope="session")
def law() -> Callable[[str], Controller]:
    known = Knowledge(REFERENCE_PLANT, PAPER_LINEAR, *paper_gains())
    return lambda name: CONTROLLERS[name](known)
