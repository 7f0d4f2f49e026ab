"""A planned sequence recorded fifty times: how many recordings keep all wanted widths. And: is the least cost found?

Run: python -m benchmarks.recorded_kept [recordings] [plants]
"""

import sys
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from benchmarks.recorded_plan import DENSITY, NOISE, plant
from benchmarks.recorded_speed import missed_by, setup_for
from eaid.planning.excitation import ExcitationOptions, kept_share, sequence_for
from eaid.planning.played import measure
from eaid.recorded.log import recorded_log
from eaid.recorded.sequence import Limits
from eaid.recorded.solve import solve
from eaid.synth.excitation import Excitation, synthesise_excitation
from eaid.synth.plants import clutch
from eaid.uncertainty.rig_noise import Noise

WANT = {"Ts": 1.0, "tau1": 4.0, "tau2": 13.0}


SCATTER = replace(DENSITY, scatter=(0.01, 0.0, 0.0))
"""The same noise, and a gain that differs by 1 % from engagement to engagement."""


def keeps(noise: Noise, want: dict[str, float], recordings: int) -> str:
    """The reference plant's plan, recorded anew."""
    found, _ = sequence_for(plant(0), noise, ExcitationOptions(want), Limits())
    rows = measure(found, plant(0), noise, recordings, seed=10**6)
    share = 100 * kept_share(rows, want)
    return (
        f"{found.time_s:.0f} s, {found.engagements} engagements; {share:.0f} % of {recordings} recordings keep {want}"
    )


def least(plants: int) -> str:
    """Random plants with noise: our cost over that of least squares from the truth."""
    over = []
    for k in range(1, plants + 1):
        p = plant(k)
        e = Excitation("random", 90.0, rate_hz=50.0, hold_s=(0.5, 8.0))
        log = recorded_log(synthesise_excitation(clutch(p), e, replace(NOISE, white_nm=0.01), k)[0])
        setup = setup_for(log)
        found = solve(setup)
        assert setup.model.basis is not None
        truth = np.append(setup.model.basis.unknowns(p), 0.0)
        best = least_squares(missed_by(setup), truth, x_scale="jac", ftol=1e-14, xtol=1e-14, gtol=1e-14)
        over.append(found.cost / (2 * best.cost) - 1)
    worse = int((np.array(over) > 1e-6).sum())
    return f"{plants - worse} of {plants} plants at the least cost known within 1e-6; worst {max(over):.1e} above it"


if __name__ == "__main__":
    print(least(int(sys.argv[2]) if len(sys.argv) > 2 else 100), flush=True)
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 50
    print(keeps(DENSITY, WANT, count), flush=True)
    print(keeps(SCATTER, WANT | {"Ts": 1.5}, count))
