"""Rig time: a planned sequence against the classic recording, on the reference plant and ten others.

Classic: ten levels, three repeats, 10 s idle + 20 s held + 10 s released, rising parts fitted: 1200 s. Noise 0.006 N·m
white and 1 % of the torque coloured (0.3 s), 200 Hz, no scatter between runs. Errors of the curves over ten duties
(rms, relative) of so many recordings of each. Run: python -m benchmarks.recorded_plan [plants] [sets]
"""

import sys
from dataclasses import replace

import numpy as np
from eaid.recorded.options import RecordedOptions

from eaid.fitting.data import data_of
from eaid.fitting.nonlinear import fit_nonlinear
from eaid.models import nonlinear
from eaid.models.parameters import REFERENCE_PLANT, Nonlinear
from eaid.planning.played import recording
from eaid.recorded.design import plan_excitation
from eaid.recorded.fit import fit_recorded
from eaid.recorded.sequence import Limits
from eaid.steps.build import build_stepset
from eaid.steps.cut_runs import StepOptions
from eaid.synth.disturbance import NONE
from eaid.synth.logs import Protocol, synthesise
from eaid.synth.plants import clutch
from eaid.uncertainty.rig_noise import Noise

DENSITY = Noise(0.006**2 / 200, 2 * 0.3 * 0.01**2, (0.0, 0.0, 0.0))
NOISE = replace(NONE, white_nm=0.006, coloured=0.01, coloured_s=0.3)
WANT = {"Ts": 1.0, "tau1": 2.7, "tau2": 12.0}
CLASSIC = Protocol(tuple(np.linspace(10, 100, 10).tolist()), 3, 10.0, 20.0, 10.0, 200.0)
CLASSIC_S = 1200.0
DUTY = np.linspace(10, 100, 10)


def plant(k: int) -> Nonlinear:
    """The reference plant, or one with other factors on T_s, τ1 and τ2 and other bends."""
    if k == 0:
        return REFERENCE_PLANT
    draw = np.random.default_rng(k)
    a, b, c = np.exp(draw.normal(0, 0.35, 3))
    bend = draw.uniform(0.7, 1.1, 2)
    p = REFERENCE_PLANT
    return replace(
        p,
        tau1=(a * p.tau1[0], a * p.tau1[1], a * bend[0] * p.tau1[2]),
        tau2=(b * p.tau2[0], b * p.tau2[1], b * bend[1] * p.tau2[2]),
        Ts=tuple(c * one for one in p.Ts),
    )


def errors(p: Nonlinear, found: Nonlinear) -> np.ndarray:
    """log of T_s, τ1, τ2 over the truth, (3, 10)."""

    def curves(one: Nonlinear) -> np.ndarray:
        return np.array([nonlinear.steady_torque(one, DUTY), *nonlinear.time_constants(one, DUTY)])

    return np.asarray(np.log(np.maximum(curves(found), 1e-9) / curves(p)))


def row(k: int, sets: int) -> tuple[str, bool]:
    p = plant(k)
    plan = plan_excitation(p, DENSITY, WANT, Limits(), seed=k)
    ours, classic = [], []
    for seed in range(sets):
        run = recording(plan, p, NOISE, seed, 200.0)
        options = RecordedOptions(models=("nonlinear",), u_range=(10.0, 100.0), falls="as-rises", ci="none")
        fit = fit_recorded([run], options)
        assert fit.nonlinear is not None
        ours.append(errors(p, fit.nonlinear.parameters))
        steps = build_stepset(synthesise(clutch(p), CLASSIC, NOISE, seed), StepOptions())
        classic.append(errors(p, fit_nonlinear(data_of(steps.levels), 0.85).parameters))
    a, b = (100 * np.sqrt(np.mean(np.array(one) ** 2, axis=(0, 2))) for one in (ours, classic))
    good = plan.time_s <= 0.25 * CLASSIC_S and a[1] <= b[1] and a[2] <= b[2] and a[0] <= 1.0
    cells = [f"{x:.2g} / {y:.2g}" for x, y in zip(a, b, strict=True)]
    name = "reference" if k == 0 else f"other {k}"
    text = f"| {name} | {plan.time_s:.0f} s | {100 * plan.time_s / CLASSIC_S:.0f} % | " + " | ".join(cells)
    return text + f" | {'yes' if good else 'no'} |", good


def main() -> None:
    """Print the table."""
    plants = int(sys.argv[1]) if len(sys.argv) > 1 else 11
    sets = int(sys.argv[2]) if len(sys.argv) > 2 else 20
    print("| plant | planned | of 1200 s | T_s, planned / classic [%] | τ1 [%] | τ2 [%] | kept |")
    print("|---|---|---|---|---|---|---|")
    for k in range(plants):
        print(row(k, sets)[0], flush=True)


if __name__ == "__main__":
    main()
