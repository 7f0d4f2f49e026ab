"""The spread over drawn plants: metrics of each, worst of each, bands; the same on one thread and on many."""

import dataclasses

import numpy as np
import pytest

from eaid.models.parameters import REFERENCE_PLANT
from eaid.replay import references
from eaid.replay.loop import replay
from eaid.replay.many import QUANTILES, flattened, montecarlo
from eaid.replay.plant import plant_parameters
from eaid.replay.references import measure
from eaid.replay.rig import Rig
from eaid.results.replay import Worst

DT = 1e-3
SCALES = (0.8, 0.9, 1.0, 1.05, 1.1)
PLANTS = [dataclasses.replace(REFERENCE_PLANT, Ts=tuple(s * c for c in REFERENCE_PLANT.Ts)) for s in SCALES]


def test_each_plant_has_the_metrics_of_its_own_replay(law):
    reference = references.steps(DT, 6.0, levels_nm=(0.0, 2.0, 4.0))
    ticks = []
    found = montecarlo(PLANTS, law("pi"), reference, Rig(), 5, None, lambda: ticks.append(1))
    assert len(ticks) == 5
    for i, plant in enumerate(PLANTS):
        alone = measure(replay(plant_parameters(plant), law("pi"), reference.torque_nm, Rig(), DT, 5), reference)
        for name, value in flattened(alone):
            assert found.values[name][i] == pytest.approx(value, rel=1e-9, abs=1e-12, nan_ok=True)
    assert "steps[2].settling_s" in found.values and "steps[1].from_nm" not in found.values


def test_the_worst_plant_is_named_with_its_parameters_and_never_is_worse_than_late(law):
    reference = references.steps(DT, 6.0, levels_nm=(0.0, 2.0, 4.0))
    found = montecarlo(PLANTS, law("pi"), reference, Rig())
    summary = found.summary(PLANTS)
    error = summary.metrics["rms_error_nm"]
    worst = int(np.argmax(found.values["rms_error_nm"]))
    assert error.worst == Worst(
        pytest.approx(found.values["rms_error_nm"][worst]), worst, PLANTS[worst].tau1, PLANTS[worst].tau2,
        PLANTS[worst].Ts,
    )  # fmt: skip
    assert error.low <= error.median <= error.high <= error.worst.value * (1 + 1e-12)
    late = summary.metrics["steps[2].settling_s"]
    assert late.never >= 1 and late.worst.value is None and late.worst.plant == 0


def test_bands_are_quantiles_over_the_plants(law):
    reference = references.multisine(DT, 2.0)
    found = montecarlo(PLANTS, law("open-loop"), reference, Rig())
    assert found.band_nm.shape == (len(QUANTILES), len(found.band_time_s)) and len(found.band_time_s) <= 1000
    weak, strong = (
        replay(plant_parameters(p), law("open-loop"), reference.torque_nm, Rig(), DT).torque_nm[::2]
        for p in (PLANTS[0], PLANTS[-1])
    )
    assert found.band_nm[0] == pytest.approx(weak, abs=1e-12)
    assert found.band_nm[-1] == pytest.approx(strong, abs=1e-12)


def test_more_threads_than_there_is_work_for_are_not_begun(law):
    reference = references.multisine(DT, 0.1)
    one, many = (montecarlo(PLANTS * 10, law("pi"), reference, Rig(), 0, threads) for threads in (1, 10**12))
    assert one.band_nm.tobytes() == many.band_nm.tobytes()


def test_a_tone_is_worst_where_it_is_farthest_from_zero_decibels(law):
    reference = references.sweep(DT, frequencies_hz=(1.0,))
    summary = montecarlo(PLANTS, law("open-loop"), reference, Rig()).summary(PLANTS)
    gains = summary.metrics["frequencies[1 Hz].gain_db"]
    assert gains.worst.plant == 0 and gains.worst.value < gains.low < 0
