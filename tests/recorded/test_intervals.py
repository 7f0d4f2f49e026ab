"""The variance of the scores, estimated from residuals that the fit has taken power out of."""

from dataclasses import replace

import numpy as np
import pytest

import eaid
from eaid.models.parameters import REFERENCE_PLANT
from eaid.recorded.fit import fit_recorded
from eaid.synth.excitation import Excitation, synthesise_excitation
from eaid.synth.logs import NONE
from eaid.synth.plants import clutch

RATE_HZ, MEMORY_S, SHARE = 100.0, 0.3, 0.01


@pytest.mark.slow
def test_intervals_hold_what_engagements_scatter() -> None:
    """Gains that differ by 2 % from engagement to engagement: T_s and τ1 of most logs lie within their intervals."""
    from eaid.models.nonlinear import steady_torque, time_constants

    noise = replace(NONE, white_nm=0.006, coloured=0.01, coloured_s=0.3)
    e = Excitation(kind="random", duration_s=240.0, rate_hz=50.0, hold_s=(0.5, 8.0), rest_s=8.0)
    held = []
    for seed in range(8):
        run = synthesise_excitation(clutch(), e, noise, 500 + seed)[0]
        which = np.cumsum(np.append(0, (run.input[1:] > 0) & (run.input[:-1] == 0)))
        gain = 1 + 0.02 * np.random.default_rng(seed).standard_normal(int(which.max()) + 1)
        options = eaid.FitOptions(model=("nonlinear",), duty=(10.0, 100.0))
        fit = fit_recorded([replace(run, output=run.output * gain[which])], options)
        assert fit.nonlinear is not None
        for one in fit.nonlinear.curves:
            assert one.ci95 is not None
            truth = steady_torque(REFERENCE_PLANT, one.level), time_constants(REFERENCE_PLANT, one.level)[0]
            for true, ends in zip(truth, (one.ci95.Ts, one.ci95.tau1), strict=True):
                held.append(ends is not None and ends[0] <= true <= ends[1])
    assert np.mean(held) > 0.8
