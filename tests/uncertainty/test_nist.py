"""NIST StRD: certified parameters and standard deviations of y = b1 (1 − e^(−b2 x)), the linear model on one level.

The two data sets are in the public domain (www.itl.nist.gov/div898/strd/nls).
"""

import numpy as np
import pytest

from eaid.apparatus import Apparatus
from eaid.fitting.fit import fit
from eaid.options import FitOptions
from eaid.steps.stepset import Level, StepSet
from eaid.uncertainty.intervals import with_intervals
from eaid.uncertainty.runs import t_quantile

BOXBOD = ([1, 2, 3, 5, 7, 10], [109, 149, 149, 191, 213, 224])
MISRA1A = (
    [77.6, 114.9, 141.1, 190.8, 239.9, 289.0, 332.8, 378.4, 434.8, 477.3, 536.8, 593.1, 689.1, 760.0],
    [10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02, 44.82, 50.76, 55.05, 61.01, 66.40, 75.47, 81.78],
)
CERTIFIED = {
    "BoxBOD": (BOXBOD, 2.1380940889e02, 1.2354515176e01, 5.4723748542e-01, 1.0455993237e-01),
    "Misra1a": (MISRA1A, 2.3894212918e02, 2.7070075241e00, 5.5015643181e-04, 7.2668688436e-06),
}


@pytest.mark.parametrize("name", list(CERTIFIED))
def test_certified_standard_deviations(name: str) -> None:
    (x, y), gain, gain_sd, rate, rate_sd = CERTIFIED[name]
    level = Level(1.0, np.array(x, dtype=float), np.array([y], dtype=float), (name,))
    stepset = StepSet("clutch", "%", "N·m", Apparatus(), (level,))
    found = fit(stepset, FitOptions(model=("linear",)))
    assert found.linear is not None
    row = found.linear.per_level[0]
    assert (row.gain, row.a0) == (pytest.approx(gain, rel=1e-7), pytest.approx(rate, rel=1e-7))
    white = with_intervals(stepset, found, FitOptions(ci="white"))
    assert white.linear is not None
    ends, t = white.linear.per_level[0].ci95, t_quantile(len(x) - 2)
    assert ends is not None and ends.gain is not None and ends.a0 is not None
    sd = [float(high - low) / 2 / t for low, high in (ends.gain, ends.a0)]
    assert tuple(sd) == (pytest.approx(gain_sd, rel=1e-6), pytest.approx(rate_sd, rel=1e-6))
