"""Do the intervals of recorded fits hold? Simulated logs of the reference plant, fitted, and the truth looked for.

Each row: so many sets of one log; white noise 0.006 N·m, coloured noise of 1 % of the torque (0.3 s), 200 Hz. Coverage
of the 95 % intervals of T_s(u), τ1(u), τ2(u) at ten duties, mean and least over these; every interval that is
quoted counts. Run: python -m benchmarks.recorded_coverage [sets] [row …]
"""

import sys
from dataclasses import replace

import numpy as np
from eaid.recorded.options import RecordedOptions

from eaid.models import nonlinear
from eaid.models.parameters import REFERENCE_PLANT
from eaid.recorded.fit import fit_recorded
from eaid.synth.disturbance import NONE
from eaid.synth.excitation import Excitation, synthesise_excitation
from eaid.synth.plants import clutch

NOISE = replace(NONE, white_nm=0.006, coloured=0.01, coloured_s=0.3)
ROWS = {
    "random steps, 240 s": (Excitation("random", 240.0, rate_hz=200.0), {}),
    "staircase of 12 s, 240 s": (Excitation("staircase", 240.0, rate_hz=200.0, hold_s=(0.5, 12.0)), {}),
    "staircase of 6 s, 480 s": (Excitation("staircase", 480.0, rate_hz=200.0, hold_s=(0.5, 6.0)), {}),
    "random steps, rests, 240 s": (Excitation("random", 240.0, rate_hz=200.0, hold_s=(0.5, 10.0), rest_s=8.0), {}),
    "closed loop, 240 s, direct": (Excitation("closed-loop", 240.0, rate_hz=200.0, hold_s=(0.5, 12.0)), {}),
    "closed loop, 240 s, instrument": (
        Excitation("closed-loop", 240.0, rate_hz=200.0, hold_s=(0.5, 12.0)),
        {"instrument": True},
    ),
}
DUTY = np.linspace(10, 100, 10)


def truth_at(u: float) -> list[float]:
    """T_s, τ1, τ2 of the reference plant."""
    steady, taus = nonlinear.steady_torque(REFERENCE_PLANT, u), nonlinear.time_constants(REFERENCE_PLANT, u)
    return [float(steady), *(float(one) for one in taus)]


def row(name: str, sets: int) -> str:
    """One row of the table."""
    e, choices = ROWS[name]
    plant = clutch()
    held = np.full((sets, 3, len(DUTY)), np.nan)
    width = np.full((sets, 3, len(DUTY)), np.nan)
    error = np.full((sets, 3, len(DUTY)), np.nan)
    for k in range(sets):
        run = synthesise_excitation(plant, e, NOISE, 1000 + k)[0]
        options = RecordedOptions(models=("nonlinear",), u_range=(10.0, 100.0), **choices)
        found = fit_recorded([run], options)
        assert found.nonlinear is not None
        curves = found.nonlinear.curves
        at = [one.level for one in curves]
        for p, name_p in enumerate(("Ts", "tau1", "tau2")):
            for i, u in enumerate(DUTY):
                j = int(np.argmin(np.abs(np.array(at) - u)))
                true = truth_at(at[j])[p]
                ends = getattr(curves[j].ci95, name_p)
                value = getattr(curves[j], name_p)
                error[k, p, i] = np.log(value / true)
                if ends is None:
                    continue
                width[k, p, i] = np.sqrt(ends[1] / ends[0]) - 1
                held[k, p, i] = ends[0] <= true <= ends[1]
    cells = []
    for p in range(3):
        counted = np.isfinite(held[:, p]).sum(axis=0) > sets // 4
        each = 100 * np.nanmean(held[:, p][:, counted], axis=0)
        cells.append(
            f"{each.mean():.0f} ({each.min():.0f}) ±{100 * np.nanmedian(width[:, p]):.2g} %, "
            f"rms {100 * np.sqrt(np.nanmean(error[:, p] ** 2)):.2g} %, bias {100 * np.nanmean(error[:, p]):+.2g} %"
        )
    return f"| {name} | {sets} | " + " | ".join(cells) + " |"


def main() -> None:
    """Print the table."""
    sets = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    print("| log | sets | T_s: mean (least), half-width, error | τ1 | τ2 |\n|---|---|---|---|---|")
    for name in sys.argv[2:] or ROWS:
        print(row(name, sets), flush=True)


if __name__ == "__main__":
    main()
