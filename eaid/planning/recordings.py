"""A fit and the interval widths that are wanted → the session to record: levels, holds, repeats, order."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import inf, sqrt

import msgspec
import numpy as np

from eaid.control.defaults import counted_from_rest
from eaid.estimate.data import data_of
from eaid.findings import finding
from eaid.levels.certainty import estimate_levels_first
from eaid.levels.each_level import own_levels
from eaid.options import PlanOptions
from eaid.planning.kinds import PARAMETERS, is_clutch, session_widths
from eaid.planning.widths import KEEPING, Widths, fitted_rig, percent, settled, wanting
from eaid.plant.steps import step_response
from eaid.results.fit import Fit
from eaid.results.models import Noise
from eaid.results.plan import Plan, PlannedRun
from eaid.steps.stepset import Level
from eaid.synth.logs import NONE, Disturbance, read_sensor, scatter
from eaid.synth.plants import Specimen

RATE_HZ = 100.0  # Samples a second of a simulated recording
MEMORY_S = 0.05  # Time constant of its coloured noise [s]
PLAN_SETS, FEW_SETS = 14, 4  # Recordings that are simulated of each plan; of other kinds, whose widths hardly scatter
# Findings of a fit that no plan can be trusted on
OPEN_FINDINGS = ("one-level-nonlinear", "parameter-unknown-at-half-the-levels", "no-level-determines-all")
FIRST_REPEATS = 5  # … so that the next session asks for so many repeats at the most, and the next fit knows more
NOTICED_SCATTER = 0.01  # Scatter from run to run that is named as what stands in the way of a width


def experiment(plan: Plan, plant: Specimen, noise: Noise, seed: int) -> tuple[Level, ...]:
    """The levels of one simulated recording."""
    disturbance = simulated_disturbance(noise)
    levels = []
    for i, (level, hold_s) in enumerate(zip(plan.levels, plan.hold_s, strict=True)):
        random, time_s = np.random.default_rng([seed, i]), np.arange(round(hold_s * RATE_HZ)) / RATE_HZ
        runs = []
        for _ in range(plan.repeats):
            torque_nm = step_response(scatter(disturbance, random).of(plant.at(level)), time_s)
            runs.append(read_sensor(torque_nm, time_s, np.zeros_like(time_s), disturbance, random))
        levels.append(Level(level, time_s, np.array(runs), tuple(map(str, range(plan.repeats)))))
    return tuple(levels)


def simulated_disturbance(noise: Noise, rate_hz: float = RATE_HZ) -> Disturbance:
    """The noise and the scatter of a fit as a simulated recording has them; its memory goes with the rate."""
    scatter_of = {f"{name}_scatter": noise.scatter[name] for name in ("tau1", "tau2")}
    memory_s = MEMORY_S * RATE_HZ / rate_hz
    coloured = sqrt(noise.ripple_s / (2 * memory_s))
    return replace(
        NONE, white_nm=sqrt(noise.sensor_nm2_s * rate_hz), coloured=coloured, coloured_s=memory_s,
        gain_scatter=min(noise.scatter["Ts"], 0.3), **scatter_of,
    )  # fmt: skip


def plan_recordings(fit: Fit, options: PlanOptions, progress: Callable[[], None]) -> Plan:
    """The quickest session on the rig whose intervals are as narrow as is wanted: what `eaid.plan` calls.

    `UsageError` for a width of no parameter or a limit that no rig has; `DataError` for a fit without a model of steps.
    """
    rig = fitted_rig(fit)
    guessed = any(one.code in OPEN_FINDINGS for one in fit.findings)
    decays = [each for each in fit.findings if each.code == "output-decays-under-hold"]
    rig = replace(rig, most=FIRST_REPEATS) if guessed or decays else rig
    options = wanting(options, dict(zip(rig.numbers, (3.0, 5.0, 10.0), strict=False)))
    order = partial(run_order, rests_s=rig.rests(options), seed=options.seed)
    other = rig.plant.model if rig.plant.model is not None and not is_clutch(rig.plant.model) else None
    sets = PLAN_SETS if other is None else FEW_SETS
    rigs = rig.drawn(sets, options.seed) if options.check and other is None else []

    def measure(plan: Plan, k: int) -> Widths:
        """Half-widths of one recording's own intervals at the worst level [%]."""
        if other is not None:
            found = session_widths(other, rig.noise, order(plan), k, options.seed)
            return dict(zip(rig.numbers, percent(found).tolist(), strict=True))
        plant, noise = rigs[k]
        levels = experiment(plan, plant, noise, options.seed + 100_000 * k)
        data = data_of(levels)
        if plant.kind == "clutch" and len(levels) > 1:  # of the curves
            low, high, _ = estimate_levels_first(levels, data, rig.share).intervals(data.u)
        else:
            low, high, _ = own_levels(levels, data, rig.share).intervals
        return dict(zip(PARAMETERS, percent(0.5 * (high - low).max(axis=1)).tolist(), strict=True))

    make = partial(rig.quickest, session=options)
    plan, worst, width = settled(make, measure, options, sets, KEEPING, progress)
    if other is not None and (by_simulation := plan.measured_half_width_pct) is not None:
        plan = msgspec.structs.replace(plan, half_width_pct=by_simulation)  # not those of information alone
    findings = counted_from_rest(fit, (0.0, max(rig.levels)))
    findings += rig.told
    findings += [finding("plan-of-decaying-output", "plan", each.levels) for each in decays]
    if guessed:
        findings.append(finding("plan-rests-on-a-guess", "plan"))
    if not plan.met:
        scatter = 100 * rig.noise.scatter.get(worst, 0.0)
        findings.append(finding(
            "plan-falls-short", "plan", parameter=worst, repeats=plan.repeats,
            width_pct=width if width < inf else None, wanted_pct=options.want[worst],
            scatter_pct=scatter if scatter > 100 * NOTICED_SCATTER else None,
        ))  # fmt: skip
    session: Plan = msgspec.structs.replace(plan, runs=order(plan), findings=tuple(findings))
    return session


def run_order(plan: Plan, rests_s: tuple[float, float], seed: int) -> tuple[PlannedRun, ...]:
    """One block a repeat, each with all levels in an order of its own: no drift or sweep hides in the levels."""
    random = np.random.default_rng(seed)
    (idle_s, release_s), runs = rests_s, list[PlannedRun]()
    for repeat in range(1, plan.repeats + 1):
        for i in random.permutation(len(plan.levels)).tolist():
            hold_s = plan.hold_s[i]
            runs.append(PlannedRun(len(runs) + 1, plan.levels[i], repeat, idle_s, hold_s, release_s))
    return tuple(runs)
