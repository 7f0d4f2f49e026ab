"""Every kind of plant in closed loop, its dead time a part of a sample, beside SciPy's exact discretisation."""

import numpy as np
import pytest
from scipy.signal import cont2discrete, tf2ss

import eaid

from ..conftest import GAINS, LINEAR, loaded

H, PARTS = 1e-2, 4  # Control interval [s], and the pieces of one that SciPy steps by
GAIN, PI = 0.05, {"K_P": 21.0, "K_I": 60.0}
KINDS = {  # what fit.json holds, and the transfer function of unit gain: numerator and denominator
    "lag": ({"tau1": [0.3], "C": 1.0}, ([1.0], [0.3, 1.0])),
    "parallel": ({"tau1": [0.3], "tau2": [2.0], "C": 0.7}, ([0.7 * 2.0 + 0.3 * 0.3, 1.0], [0.6, 2.3, 1.0])),
    "overshoot": ({"tau1": [0.2], "tau2": [1.0], "C": 1.6}, ([1.6 - 0.6 * 0.2, 1.0], [0.2, 1.2, 1.0])),
    "series": ({"tau1": [0.2], "zeta": 1.5}, ([1.0], [0.04, 0.6, 1.0])),
    "ringing": ({"tau1": [0.1], "zeta": 0.2, "zero": 0.3}, ([0.03, 1.0], [0.01, 0.04, 1.0])),
}
REFERENCE = np.repeat([0.0, 2.0, 1.0, 3.0, 0.5], 100)


def fit_of(kind, dead_time_s):
    plant = {"kind": kind, "Ts": [0.0, GAIN], "tau2": [], "u_range": [1e-6, 100.0], "dead_time_s": dead_time_s}
    return loaded({"linear": LINEAR, "plant": {**plant, **KINDS[kind][0]}})


def second_way(kind, dead_steps):
    """True output at the samples under a PI with the limits of 0 to 100 %, by steps of H/PARTS."""
    top, bottom = KINDS[kind][1]
    A, B, C, *_ = cont2discrete(tf2ss(GAIN * np.array(top), bottom), H / PARTS, "zoh")
    x, integral, given, true = np.zeros((len(A), 1)), 0.0, [0.0] * dead_steps, []
    for wanted in REFERENCE:
        true.append((C @ x).item())
        error = wanted - true[-1]
        asked = PI["K_P"] * error + PI["K_I"] * integral
        duty = min(max(asked, 0.0), 100.0)
        if (asked - duty) * error <= 0:
            integral += H * error
        given += [duty] * PARTS
        for _ in range(PARTS):
            x = A @ x + B * given.pop(0)
    return np.array(true)


@pytest.mark.parametrize("dead_steps", [0, 4 * 3, 4 * 3 + 1, 2], ids=["none", "whole", "three and a quarter", "half"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_loop_on_every_kind_is_scipys(kind, dead_steps):
    fit, gains = fit_of(kind, dead_steps * H / PARTS), loaded({**GAINS, "pi": PI})
    assert fit.plant.kind == kind
    run = eaid.simulate(fit, gains, reference=(np.arange(len(REFERENCE)) * H, REFERENCE), controller=("pi",),
                        rate_hz=1 / H)  # fmt: skip
    columns = run.records["pi"].columns
    np.testing.assert_allclose(columns["torque_nm"], second_way(kind, dead_steps), atol=1e-9)
    assert ("applied_pct" in columns) is bool(dead_steps)
