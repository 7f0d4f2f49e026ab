"""How often an input that is noted a row late is told, and one that is not: random steps of 60 s at 100 Hz.

Run: python -m benchmarks.recorded_late [logs of each]
"""

import sys
from collections import Counter
from dataclasses import replace

import numpy as np

from eaid.recorded import model
from eaid.recorded.curve_intervals import curves
from eaid.recorded.intervals import spread
from eaid.recorded.late import delay_findings, shifted
from eaid.recorded.log import recorded_log
from eaid.recorded.problem import setup_of
from eaid.recorded.solve import solve
from eaid.synth.disturbance import NONE
from eaid.synth.excitation import Excitation, synthesise_excitation
from eaid.synth.plants import clutch

NOISE = replace(NONE, white_nm=0.006, coloured=0.01, coloured_s=0.3)
LOG = Excitation("random", 60.0, rate_hz=100.0, hold_s=(0.5, 8.0))
LEVELS = np.linspace(10, 100, 10)


def told(seed: int, late: int) -> str:
    """What is said of one log whose input is noted so many rows late."""
    log = recorded_log(synthesise_excitation(clutch(), LOG, NOISE, seed)[0])
    log = shifted(log, -late) if late else log
    solved = solve(setup_of(model.nonlinear(LEVELS, 0.85, 60.0), [log]))
    found = delay_findings(solved, [log], curves(solved, spread(solved), LEVELS))
    return f"{found[0].code}, {found[0].values['rows']} rows" if found else "nothing"


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    for late in (0, 1, -1):
        print(f"{late} rows late, {count} logs:", dict(Counter(told(seed, late) for seed in range(count))), flush=True)
