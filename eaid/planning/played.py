"""Simulated recordings of a planned sequence of duties, and the intervals of their fits."""

from collections.abc import Callable

import numpy as np

from eaid.logs.run import Run
from eaid.models.parameters import Nonlinear
from eaid.planning.enlarge import Widths
from eaid.planning.simulated import RATE_HZ, disturbance_of
from eaid.recorded.design import ExcitationPlan
from eaid.recorded.fit import fit_recorded
from eaid.recorded.options import RecordedOptions
from eaid.recorded.sequence import PARAMETERS
from eaid.results.fit import Fit
from eaid.synth.disturbance import Disturbance, measured, sample_times, scatter
from eaid.synth.logs import response
from eaid.synth.plants import clutch
from eaid.uncertainty.rig_noise import Noise


def recording(
    plan: ExcitationPlan,
    p: Nonlinear,
    disturbance: Disturbance,
    seed: int,
    rate_hz: float = RATE_HZ,
) -> Run:
    """One log of the sequence; each engagement, from its rest on, has a scatter of its own."""
    draw, plant, changes = np.random.default_rng(seed), clutch(p), plan.breaks[:-1]
    time_s = sample_times(plan.time_s, rate_hz, 0.0, draw)
    start, duty = np.array(changes).T
    place = np.searchsorted(start, time_s, side="right") - 1
    engagement = np.cumsum(duty == 0)[place]
    torque = np.empty_like(time_s)
    for number in np.unique(engagement):
        part = engagement == number
        torque[part] = response(plant, changes, time_s, scatter(disturbance, draw))[part]
    output = measured(torque, time_s, np.zeros_like(time_s), disturbance, draw)
    return Run("planned", time_s, duty[place], output, plant.input_unit, plant.output_unit, "eaid synth", "")


def measure(
    plan: ExcitationPlan,
    p: Nonlinear,
    noise: Noise,
    sets: int,
    seed: int = 0,
    progress: Callable[[], None] = lambda: None,
) -> list[Widths]:
    """Half-widths [%] at the worst duty of every recording's own intervals."""
    options = RecordedOptions(models=("nonlinear",), u_range=p.u_range, share=p.C, falls="as-rises", loop_refits=0)
    rows = []
    for k in range(sets):
        run = recording(plan, p, disturbance_of(noise), seed + 7919 * k)
        rows.append(widths(fit_recorded([run], options)))
        progress()
    return rows


def widths(fit: Fit) -> Widths:
    """Half-widths at the worst shown duty [%]; infinite where one is not known."""
    curves = fit.nonlinear.curves if fit.nonlinear is not None else ()
    worst = dict.fromkeys(PARAMETERS, 0.0 if curves else float("inf"))
    for level in curves:
        for name in PARAMETERS:
            ends = getattr(level.ci95, name)
            width = float("inf") if ends is None or ends[0] <= 0 else 100 * ((ends[1] / ends[0]) ** 0.5 - 1)
            worst[name] = max(worst[name], width)
    return worst
