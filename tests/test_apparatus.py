"""Eq. (1) and the numbers that specification 1 gives for it."""

import pytest

from eaid.apparatus import Apparatus


def test_area_and_stress_of_the_published_forces() -> None:
    rig = Apparatus()
    assert rig.area_m2 == pytest.approx(6.283e-3, abs=5e-7)
    assert rig.stress_kpa(17) == pytest.approx(2.706, abs=5e-4)
    assert rig.stress_kpa(170) == pytest.approx(27.06, abs=5e-3)


def test_shear_stress_and_field_of_the_clutch() -> None:
    rig = Apparatus()
    assert rig.shear_kpa(4.37) == pytest.approx(6.86, abs=5e-3)
    assert rig.field_v_per_um == pytest.approx(3.16, abs=5e-3)


def test_friction_coefficient_of_table_one() -> None:
    rig = Apparatus(surfaces=1)
    assert rig.friction_coefficient(0.0944 * 27 - 0.0896, 27) == pytest.approx(0.286, abs=5e-4)
