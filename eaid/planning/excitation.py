"""A fit and wanted widths → the shortest sequence of inputs for one recording, checked by simulated recordings."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from eaid.declared import keyed, pairs
from eaid.errors import DataError
from eaid.estimate.scatter import Noise
from eaid.findings import finding
from eaid.logs.run import Run
from eaid.models.parameters import Nonlinear
from eaid.options import FitOptions, Limits, PlanOptions
from eaid.planning.design import PARAMETERS, Widths, enlarged, finite, kept_widths, over, rig_of
from eaid.planning.recordings import RATE_HZ, disturbance_of, refuse_widths
from eaid.planning.sequences import ExcitationPlan, plan_excitation, refuse_scattered
from eaid.recorded.fit import fit_recorded
from eaid.replay.plant import driven
from eaid.results.fit import Fit
from eaid.results.plan import Excitation
from eaid.synth.logs import Disturbance, measured, scatter
from eaid.synth.plants import clutch


def recording(
    plan: ExcitationPlan,
    p: Nonlinear,
    disturbance: Disturbance,
    seed: int,
    rate_hz: float = RATE_HZ,
) -> Run:
    """One log of the sequence; each engagement, from its rest on, has a scatter of its own."""
    draw, plant = np.random.default_rng(seed), clutch(p)
    time_s = np.arange(round(plan.time_s * rate_hz)) / rate_hz
    start, duty = np.array(plan.breaks[:-1]).T
    place = np.searchsorted(start, time_s, side="right") - 1
    engagement = np.cumsum(duty == 0)[place]
    torque = np.empty_like(time_s)
    for number in np.unique(engagement):
        part = engagement == number
        torque[part] = driven(plant.pull(scatter(disturbance, draw)), start, duty, time_s)[part]
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
    options = FitOptions(model=("nonlinear",), duty=p.u_range, share=p.C)
    rows = []
    for k in range(sets):
        run = recording(plan, p, disturbance_of(noise), seed + 7919 * k)
        rows.append(widths(fit_recorded([run], options, falls=False)))
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


# Recordings that are simulated of each sequence, and the probability that a recording keeps a width: 19 of 20 do
SETS, KEEPING = 20, 19 / 21


def shortest_recording(
    fit: Fit, options: PlanOptions | None = None, progress: Callable[[], None] = lambda: None
) -> Excitation:
    """The shortest sequence that identifies a fit's plant to the wanted widths: what `eaid.plan_excitation` calls.

    `UsageError` for a width of no parameter or one that the scatter keeps out of reach, and for limits that leave
    nothing; `DataError` for a fit without a nonlinear model.
    """
    options = options or PlanOptions()
    options = replace(options, want=options.want or {"Ts": 1.0, "tau1": 4.0, "tau2": 13.0})
    refuse_widths(options.want)
    if fit.nonlinear is None:
        raise DataError("the fit holds no nonlinear model, which a sequence is planned with; fit clutch logs with it")
    rig = rig_of(fit)
    refuse_scattered(rig.noise, options.want)
    limits = limits_of(options, fit.plant.u_range, rig.plant.input_unit)
    plan, rows = sequence_for(fit.plant, rig.noise, options, limits, progress)
    measured = None if rows is None else kept_widths(rows, KEEPING)
    widths = measured or plan.half_width_pct
    excess = over(widths, options.want)
    worst = max(excess, key=excess.__getitem__)
    findings = [] if rig.known else [finding("plan-assumes-noise", "plan")]
    if excess[worst] > 1:
        findings.append(
            finding(
                "excitation-short", "plan",
                most_s=plan.time_s, parameter=worst, width_pct=widths[worst], wanted_pct=options.want[worst],
            )
        )  # fmt: skip
    steps = replace(rig, levels=limits.duty).quickest(options.want, PlanOptions())
    return Excitation(
        seed=options.seed,
        wanted=dict(options.want),
        met=excess[worst] <= 1,
        time_on_rig_s=plan.time_s,
        engagements=plan.engagements,
        half_width_pct={**plan.half_width_pct},
        measured_half_width_pct=None if measured is None else finite(measured),
        classic_time_on_rig_s=steps.time_s if steps.met else None,
        input_unit=rig.plant.input_unit,
        duty=plan.breaks,
        findings=tuple(findings),
    )


def limits_of(options: PlanOptions, duty: tuple[float, float], unit: str) -> Limits:
    """What the rig allows; by itself inputs within `duty`."""
    if isinstance(options.limits, Limits):
        return options.limits
    return replace(keyed(Limits, "«limits»", {"duty": duty, **pairs("«limits»", options.limits)}), unit=unit)


def sequence_for(
    p: Nonlinear, noise: Noise, options: PlanOptions, limits: Limits, progress: Callable[[], None] = lambda: None
) -> tuple[ExcitationPlan, list[Widths] | None]:
    """A sequence, and the widths of simulated recordings; longer until 19 of 20 keep what is wanted."""

    def make(wanted: Mapping[str, float]) -> ExcitationPlan:
        return plan_excitation(p, noise, wanted, limits, options.seed)

    def simulated(plan: ExcitationPlan) -> list[Widths]:
        return measure(plan, p, noise, SETS, options.seed, progress)

    return enlarged(make, simulated, options.want, KEEPING) if options.check else (make(options.want), None)
