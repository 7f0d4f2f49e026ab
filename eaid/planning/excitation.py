"""A fit and wanted widths → the shortest sequence of inputs for one recording, checked by simulated recordings."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import msgspec
import numpy as np

from eaid.declared import keyed, pairs
from eaid.errors import DataError
from eaid.estimate.forms import nonlinear
from eaid.estimate.from_logs import finished, setup_of
from eaid.estimate.log_intervals import held, spread
from eaid.estimate.record import RecordedLog
from eaid.findings import finding
from eaid.models.parameters import Nonlinear
from eaid.options import Limits, PlanOptions
from eaid.planning.design import PARAMETERS, Widths, rig_of, settled, wanting
from eaid.planning.recordings import RATE_HZ, disturbance_of
from eaid.planning.sequences import DUTIES, plan_excitation, refuse_scattered
from eaid.replay.plant import driven
from eaid.results.fit import Fit, Noise
from eaid.results.plan import Excitation
from eaid.synth.logs import measured, scatter
from eaid.synth.plants import clutch


def measure(plan: Excitation, p: Nonlinear, noise: Noise, k: int, seed: int = 0) -> Widths:
    """Half-widths [%] at the worst duty, as the `k`-th recording tells them where its fit to the log ends.

    It is one log of the sequence; each engagement, from its rest on, has a scatter of its own.
    """
    draw, plant, disturbance = np.random.default_rng(seed + 7919 * k), clutch(p), disturbance_of(noise)
    time_s = np.arange(round(plan.time_on_rig_s * RATE_HZ)) / RATE_HZ
    start, duty = np.array(plan.duty[:-1]).T
    place = np.searchsorted(start, time_s, side="right") - 1
    engagement = np.cumsum(duty == 0)[place]
    torque = np.empty_like(time_s)
    for number in np.unique(engagement):
        part = engagement == number
        torque[part] = driven(plant.pull(scatter(disturbance, draw)), start, duty, time_s)[part]
    output = measured(torque, time_s, np.zeros_like(time_s), disturbance, draw)
    duties = np.linspace(*p.u_range, DUTIES)
    model = nonlinear(duties, p.C)
    setup = setup_of(model, [RecordedLog("planned", time_s, duty[place], output)])
    solved = finished(setup, [np.append(model.unknowns(p), np.zeros(setup.size - model.size))])
    known, slopes = spread(solved), setup.slopes(duties)
    half = np.apply_along_axis(known.of, 2, slopes) / (slopes @ solved.x)
    unknown = [name in held(solved) for name in PARAMETERS]
    worst = np.where(unknown, np.inf, np.expm1(np.minimum(half.max(axis=1), 50.0)))
    return dict(zip(PARAMETERS, (100 * worst).tolist(), strict=True))


# Recordings that are simulated of each sequence, and the probability that a recording keeps a width: 19 of 20 do
SETS, KEEPING = 20, 19 / 21


def shortest_recording(
    fit: Fit, options: PlanOptions | None = None, progress: Callable[[], None] = lambda: None
) -> Excitation:
    """The shortest sequence that identifies a fit's plant to the wanted widths: `eaid.plan(fit, excitation=True)`.

    `UsageError` for a width of no parameter or one that the scatter keeps out of reach, and for limits that leave
    nothing; `DataError` for a fit without a nonlinear model.
    """
    options = wanting(options, {"Ts": 1.0, "tau1": 4.0, "tau2": 13.0})
    if fit.nonlinear is None:
        raise DataError("the fit holds no nonlinear model, which a sequence is planned with; fit clutch logs with it")
    rig = rig_of(fit)
    refuse_scattered(rig.noise, options.want)
    limits = limits_of(options, fit.plant.u_range, rig.plant.input_unit)
    plant, noise = fit.plant, rig.noise
    plan, worst, width = settled(  # longer until 19 of 20 recordings keep what is wanted
        partial(plan_excitation, plant, noise, limits=limits, seed=options.seed),
        lambda plan, k: measure(plan, plant, noise, k, options.seed), options, SETS, KEEPING, progress,
    )  # fmt: skip
    findings = [] if rig.known else [finding("plan-assumes-noise", "plan")]
    if not plan.met:
        findings.append(
            finding(
                "excitation-short", "plan",
                most_s=plan.time_on_rig_s, parameter=worst, width_pct=width, wanted_pct=options.want[worst],
            )
        )  # fmt: skip
    steps = replace(rig, levels=limits.duty).quickest(options.want, PlanOptions())
    classic_s = steps.time_on_rig_s if steps.met else None
    sequence: Excitation = msgspec.structs.replace(
        plan, classic_time_on_rig_s=classic_s, input_unit=rig.plant.input_unit, findings=tuple(findings)
    )
    return sequence


def limits_of(options: PlanOptions, duty: tuple[float, float], unit: str) -> Limits:
    """What the rig allows; by itself inputs within `duty`."""
    if isinstance(options.limits, Limits):
        return options.limits
    return replace(keyed(Limits, "«limits»", {"duty": duty, **pairs("«limits»", options.limits)}), unit=unit)
