"""A planned sequence is checked by doing it: synthesised some times over, fitted, and its own intervals measured."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from eaid.logs.run import Run
from eaid.models.parameters import Nonlinear
from eaid.recorded.design import ExcitationPlan
from eaid.recorded.fit import fit_recorded
from eaid.recorded.options import RecordedOptions
from eaid.recorded.sequence import PARAMETERS
from eaid.results.nonlinear import Nonlinear as Nonlinear_
from eaid.synth.disturbance import NONE, Disturbance, sample_times, scatter
from eaid.synth.disturbance import measured as measured_torque
from eaid.synth.logs import response
from eaid.synth.plants import clutch
from eaid.uncertainty.noise import Noise

RATE_HZ = 100.0
MEMORY_S = 0.05


def disturbance_of(noise: Noise, rate_hz: float = RATE_HZ, memory_s: float = MEMORY_S) -> Disturbance:
    """White and coloured noise of these densities, and the scatter, here between engagements."""
    gain, tau1, tau2 = noise.scatter
    return replace(
        NONE,
        gain_scatter=min(gain, 0.3),
        tau1_scatter=tau1,
        tau2_scatter=tau2,
        white_nm=(noise.sensor_nm2_s * rate_hz) ** 0.5,
        coloured=(noise.ripple_s / (2 * memory_s)) ** 0.5,
        coloured_s=memory_s,
    )


def recording(found: ExcitationPlan, p: Nonlinear, noise: Disturbance, seed: int, rate_hz: float = RATE_HZ) -> Run:
    """One log of the sequence; each engagement, from its rest on, has a scatter of its own."""
    draw, plant, changes = np.random.default_rng(seed), clutch(p), found.breaks[:-1]
    time_s = sample_times(found.time_s, rate_hz, 0.0, draw)
    start, duty = np.array(changes).T
    held = np.searchsorted(start, time_s, side="right") - 1
    engagement = np.cumsum(duty == 0)[held]
    torque = np.empty_like(time_s)
    for one in np.unique(engagement):
        own = engagement == one
        torque[own] = response(plant, changes, time_s, scatter(noise, draw))[own]
    seen = measured_torque(torque, time_s, np.zeros_like(time_s), noise, draw)
    return Run("planned", time_s, duty[held], seen, "%", "N·m", "eaid synth", "")


def measured(
    found: ExcitationPlan,
    p: Nonlinear,
    noise: Disturbance,
    sets: int,
    seed: int = 0,
    tick: Callable[[], None] = lambda: None,
) -> list[dict[str, float]]:
    """Half-widths [%] at the worst duty of every recording's own intervals."""
    rows = []
    for k in range(sets):
        run = recording(found, p, noise, seed + 7919 * k)
        options = RecordedOptions(models=("nonlinear",), u_range=p.u_range, share=p.C, falls="as-rises", loop_refits=0)
        rows.append(widths(fit_recorded([run], options).nonlinear))
        tick()
    return rows


def widths(part: Nonlinear_ | None) -> dict[str, float]:
    """Half-widths at the worst shown duty [%]; infinite where one is not known."""
    assert part is not None
    found = dict.fromkeys(PARAMETERS, 0.0)
    for one in part.curves:
        for name in PARAMETERS:
            ends = getattr(one.ci95, name)
            wide = float("inf") if ends is None or ends[0] <= 0 else 100 * ((ends[1] / ends[0]) ** 0.5 - 1)
            found[name] = max(found[name], wide)
    return found


def kept(rows: Sequence[dict[str, float]], wanted: dict[str, float]) -> float:
    """Part of the recordings whose widths are all within the wanted ones."""
    return float(np.mean([all(row[name] <= width for name, width in wanted.items()) for row in rows]))
