"""A plan is checked by doing it: the experiment is synthesised some times over, and its own intervals measured."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from eaid.cli import console

if TYPE_CHECKING:
    from eaid.steps.stepset import StepSet
    from eaid.synth.plants import Plant
    from eaid.uncertainty.design import Plan, Wanted
    from eaid.uncertainty.noise import Noise

RATE_HZ = 100.0
MEMORY_S = 0.05
SETS = 5
"""Experiments that are synthesised; the median of their widths is what a user may expect."""
DAMPED = 0.7
"""Power of the excess by which a plan is asked for narrower: widths fall faster than their prediction."""
LEAST_STEP = 1.03
ROUNDS = 6
"""Times that a plan is made larger because the synthesised widths exceed the wanted ones."""


def checked(
    make: "Callable[[Sequence[Wanted]], Plan]",
    wanted: "Sequence[Wanted]",
    plant: "Plant",
    noise: "Noise",
    share: float,
    seed: int,
) -> "tuple[Plan, dict[str, float]]":
    """The plan that `make` gives for the wanted widths, larger until the synthesised ones keep them; those widths [%].

    A width measured too wide is asked for narrower in the next round. A plan that falls short even
    by its prediction is as large as the limits allow, and stays.
    """
    from dataclasses import replace

    asked = list(wanted)
    found = make(asked)
    measured = measure(found, plant, noise, share, seed)
    for _ in range(ROUNDS):
        over = [measured[one.parameter] / one.half_width_pct for one in wanted]
        if not found.met or max(over) <= 1 or max(over) == float("inf"):
            break
        asked = [
            replace(one, half_width_pct=one.half_width_pct / max(LEAST_STEP, o**DAMPED)) if o > 1 else one
            for one, o in zip(asked, over, strict=True)
        ]
        larger = make(asked)
        if larger != found:
            found, measured = larger, measure(larger, plant, noise, share, seed)
    return found, measured


def measure(found: "Plan", plant: "Plant", noise: "Noise", share: float, seed: int) -> dict[str, float]:
    """Half-width that the plan's own intervals have at the worst level [%], the median of `SETS` experiments."""
    from statistics import median

    rows = []
    with console.progress("synthesising the plan", SETS) as advance:
        for k in range(SETS):
            rows.append(widths(experiment(found, plant, noise, seed + 100_000 * k), share))
            advance()
    return {name: median(row[name] for row in rows) for name in rows[0]}


def experiment(found: "Plan", plant: "Plant", noise: "Noise", seed: int) -> "StepSet":
    """One synthesised experiment. Levels beyond 100 are scaled there: units do not change a relative width."""
    from dataclasses import replace
    from math import sqrt

    from eaid.steps.build import StepOptions, build_stepset
    from eaid.synth.disturbance import NONE
    from eaid.synth.logs import Protocol, synthesise

    disturbance = replace(
        NONE,
        white_nm=sqrt(noise.sensor_nm2_s * RATE_HZ),
        coloured=sqrt(noise.ripple_s / (2 * MEMORY_S)),
        coloured_s=MEMORY_S,
        gain_scatter=min(noise.scatter[0], 0.3),
        tau1_scatter=noise.scatter[1],
        tau2_scatter=noise.scatter[2],
    )
    scale = min(1.0, 100 / max(found.levels)) if plant.kind == "clutch" else 1.0
    scaled = plant if scale == 1 else replace(plant, at=lambda level: plant.at(level / scale))
    runs = []
    for i, (level, hold_s) in enumerate(zip(found.levels, found.hold_s, strict=True)):
        protocol = Protocol((level * scale,), found.repeats, 1.0, hold_s, 0.0, RATE_HZ)
        runs += synthesise(scaled, protocol, disturbance, seed + 1000 * i)
    return build_stepset(runs, StepOptions(kind=plant.kind))


def widths(stepset: "StepSet", share: float) -> dict[str, float]:
    """Half-width of the 95 % intervals at the worst level [%]: of the two-stage curves, for friction of the levels."""
    from math import sqrt

    import numpy as np

    from eaid.uncertainty.friction_intervals import level_rows
    from eaid.uncertainty.level_statistics import curve_degrees, curves, statistics_at_share
    from eaid.uncertainty.student_t import t_quantile

    base = statistics_at_share(stepset.levels, share)
    if stepset.kind != "clutch":
        rows = level_rows(base)
        ends = {name: [row[k].interval for row in rows] for k, name in enumerate(("Ts", "tau1", "tau2"))}
        return {
            name: max(float("inf") if end is None else 100 * (sqrt(end[1] / end[0]) - 1) for end in each)
            for name, each in ends.items()
        }
    through = curves(base)
    found = {}
    for name in ("Ts", "tau1", "tau2"):
        curve = through.get(name)
        if curve is None:
            found[name] = float("inf")
            continue
        reach = np.max(t_quantile(curve_degrees(base, curve, name)) * curve.log_sd(base.duty_pct))
        found[name] = float(100 * np.expm1(np.minimum(reach, 50.0)))
    return found
