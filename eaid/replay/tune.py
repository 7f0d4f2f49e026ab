"""Gains for a fit, and what they do on its plant: design, search, replay beside the ultimate bound.

**The search.** P's scale, ε and φ of least RMS torque error and limited chattering. A candidate is replayed on plants
drawn from the fit's uncertainty, with the torque noise that the logs show:

    error         √(mean over plants and counted samples of e²)                       [N·m]
    chattering    mean over plants and counted samples of |u_k − u_{k−1}|             [% duty]

One that chatters more than the limit, or misses 6 dB or 45° around an operating point, the duty latched, does not
count. SciPy's differential evolution looks in the logarithms of the three, from a seed; every replay meets the same
noise, so that the error is a function of the candidate.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import msgspec
import numpy as np
from scipy.optimize import Bounds as Box
from scipy.optimize import differential_evolution

from eaid.arrays import Array
from eaid.control.bounds import Bounds, bounds_of, model_of
from eaid.control.defaults import (
    OVERSHOOT_PCT,
    Scales,
    design_options,
    scales_of,
    timing_of,
    with_own_layer,
    with_own_pi,
)
from eaid.control.design import condition, design, guarantee, least_phi, mismatches
from eaid.control.gains import pi_gains, plant_of, rc_gains, why_not
from eaid.control.margins import ENOUGH_DB, ENOUGH_DEG
from eaid.control.operating import Points, keeps_margins, operating_points
from eaid.control.options import DesignOptions
from eaid.control.rc import RCGains
from eaid.control.rc_design import law_of
from eaid.errors import DataError, GainsError, UsageError
from eaid.findings import Finding, finding, ranked
from eaid.models.nonlinear import steady_torque
from eaid.models.parameters import Linear, Nonlinear
from eaid.options import Rig, TuneOptions
from eaid.progress import Progress, no_progress
from eaid.replay.controllers import pi_controller, rc_controller
from eaid.replay.many import replay_many
from eaid.replay.noise import noise_of
from eaid.replay.plant import PlantParameters, plant_parameters
from eaid.replay.references import Reference, Signal, reference_of, replayed
from eaid.results.fit import Fit
from eaid.results.gains import Candidate, Gains, Guarantee, Optimized, Replayed
from eaid.steps.stepset import StepSet
from eaid.uncertainty.draw import draw, drawable

RANGES = {"p_scale": 30.0, "epsilon": 10.0, "phi_honest_pct": 10.0}
"""Each is looked for between the start's value over and times this factor."""
GENERATION = 15
"""Candidates in a generation."""


def errors_of(
    gains: RCGains, plants: Sequence[PlantParameters], reference: Reference, noise_nm: float, seed: int
) -> Array:
    """Mean square error, largest error, mean |Δu| and share saturated of each plant, shape (4, N)."""
    table, begin = np.zeros((4, len(plants))), reference.begin
    wanted = reference.torque_nm[begin:]

    def visit(index: int, torque: Array, duty: Array) -> None:
        error, counted = np.abs(wanted - torque[begin:]), duty[begin:]
        held = (counted <= gains.duty_min) | (counted >= gains.duty_max)
        table[:, index] = (error * error).mean(), error.max(), np.abs(np.diff(counted)).mean(), held.mean()

    rig = Rig(noise_nm=noise_nm)
    replay_many(plants, rc_controller(gains), reference.torque_nm, rig, reference.dt_s, visit, seed)
    return table


def optimize(
    model: Linear, bounds: Bounds, start: DesignOptions, plants: Sequence[PlantParameters], points: Points,
    reference: Reference, noise_nm: float, limit_pct: float | None, evaluations: int, seed: int,
    tick: Callable[[], None] = lambda: None,
) -> tuple[DesignOptions, Candidate, Candidate]:  # fmt: skip
    """Search from `start`: the options that it ends at, and what they and the start did; `tick` once a candidate.

    Without a limit [% duty per sample] the start's own chattering is the most. Raises GainsError where nothing that
    was tried keeps limit and margins.
    """
    origin = {
        "p_scale": start.p_scale,
        "epsilon": start.epsilon,
        # the logarithm of no φ at all is none
        "phi_honest_pct": max(law_of(model, bounds, start).phi_honest_pct, 1e-3 * float(np.ptp(start.duty_limits_pct))),
    }

    def options_at(x: Array) -> DesignOptions:
        powers = zip(RANGES.items(), x.tolist(), strict=True)
        at = {name: origin[name] * factor**power for (name, factor), power in powers}
        # γε stays at 5 or more, where the printed switch has no jump to speak of
        return replace(start, **{**at, "epsilon": max(at["epsilon"], min(5.0 / start.gamma, start.epsilon))})

    def done_by(options: DesignOptions) -> tuple[RCGains, Candidate]:
        law = law_of(model, bounds, options)
        square, largest, chatter, saturated = errors_of(law.gains, plants, reference, noise_nm, seed)
        return law.gains, Candidate(
            p_scale=options.p_scale, epsilon=options.epsilon, phi_honest_pct=law.phi_honest_pct, B_hat=law.gains.B_hat,
            K_P=options.K_P, K_D=options.K_D, equal_pi=law.equal_pi, rms_error_nm=math.sqrt(float(square.mean())),
            worst_plant_rms_error_nm=math.sqrt(float(square.max())), max_abs_error_nm=float(largest.max()),
            mean_abs_duty_step_pct=float(chatter.mean()), saturated_fraction=float(saturated.mean()),
        )  # fmt: skip

    _, before = done_by(start)
    limit = before.mean_abs_duty_step_pct if limit_pct is None else limit_pct
    refused = 10 * before.rms_error_nm

    def cost(x: Array) -> float:
        """The error; far more where the limit is not kept or a margin is missed."""
        tick()
        try:
            gains, did = done_by(options_at(x))
        except (GainsError, UsageError):  # no ρ covers this B̂, or it lies beyond any rig
            return 100 * refused
        if did.mean_abs_duty_step_pct > limit:
            return refused * (1 + did.mean_abs_duty_step_pct / limit)
        return did.rms_error_nm if keeps_margins(gains, points, start.timing) else refused

    found = differential_evolution(
        cost, Box([-1.0] * len(RANGES), [1.0] * len(RANGES)), x0=np.zeros(len(RANGES)), rng=seed, tol=0.0, polish=False,
        popsize=GENERATION // len(RANGES), maxiter=evaluations // GENERATION - 1,
    )  # fmt: skip
    if found.fun >= refused:
        raise GainsError(
            f"nothing that was tried chatters less than {limit:.3g} % duty per sample and keeps {ENOUGH_DB:g} dB and "
            f"{ENOUGH_DEG:g}°; allow more with «chatter_limit»"
        )
    best = options_at(found.x)
    return best, before, done_by(best)[1]


def tune(
    fit: Fit,
    options: TuneOptions = TuneOptions(),  # noqa: B008 - frozen
    logs: StepSet | None = None,
    reference: str | Signal | None = None,
    reference_name: str = "",
    progress: Progress = no_progress,
) -> Gains:
    """`eaid.tune_rc` on what has been read; without a reference the multisine, which Q_M need not cover.

    Raises GainsError where fit or wishes are not physical, out of reach, or unstable on the linear model, and DataError
    where the fit lacks what is asked for.
    """
    why = why_not(fit, "linear")
    if why and not options.allow_unidentified:
        raise DataError(f"the linear model is not identifiable ({why}); «allow_unidentified» uses it, marked")
    model, plant = model_of(fit), plant_of(fit)
    scales = scales_of(fit, plant)
    given = reference is not None
    dt_s = 1 / timing_of(fit, options).rate_hz
    reference_name = reference_name or (reference if isinstance(reference, str) else "multisine")
    wanted = reference_of(reference or "multisine", dt_s, scales)
    slope = wanted.steepest_nm_s
    bounds = bounds_of(fit, options.bounds_levels, options.widen_bounds)
    shown = least_phi(mismatches(model, bounds, plant, logs, fit.data.input_unit))
    settled = design_options(
        fit, options, scales, slope if given or not scales.paper else None, None if shown is None else shown.pct
    )  # fmt: skip
    settled = with_own_pi(fit, settled, scales)
    if options.epsilon is None and options.gamma is None:
        settled = with_own_layer(fit, settled, scales, bounds, plant)
    findings: list[Finding] = _of_the_rig(fit, scales, settled)
    found = None
    if options.optimize:
        settled, found, more = _searched(fit, options, settled, plant, logs, wanted, reference_name, progress)
        findings += more
    gains = design(fit, settled, logs, slope if given else None)
    gains, more = _replayed(gains, plant, wanted, reference_name, given, fit.dead_time_s)
    findings += more
    if why:
        findings.insert(0, finding("fit-not-identifiable", "model", why=why))
    return msgspec.structs.replace(
        gains, options=options, seed=options.seed, optimized=found, unidentified=why or None,
        findings=ranked([*findings, *gains.findings]),
    )  # fmt: skip


def _of_the_rig(fit: Fit, scales: Scales, settled: DesignOptions) -> list[Finding]:
    if scales.paper:
        return []
    return [
        finding(
            "designed-for-rig", "model", input_unit=fit.data.input_unit or "no unit",
            output_unit=fit.data.output_unit or "no unit",
            pace=scales.pace, highest=settled.duty_limits_pct[1],
            overshoot_pct=settled.pi.overshoot_pct or OVERSHOOT_PCT, settling_s=settled.pi.settling_s or 0.0,
        )
    ]  # fmt: skip


def _searched(
    fit: Fit, options: TuneOptions, settled: DesignOptions, plant: Nonlinear | None, logs: StepSet | None,
    wanted: Reference, name: str, progress: Progress,
) -> tuple[DesignOptions, Optimized, list[Finding]]:  # fmt: skip
    """The options that the search ends at, and what it traded."""
    if plant is None:
        raise DataError("the fit holds no nonlinear model, which «optimize» replays on; fit clutch data with it")
    findings = []
    noise, source = noise_of(fit, options, logs)
    if source == "supposed":
        findings.append(finding("noise-supposed", "rc", noise=noise))
    drawn = [plant]
    if not drawable(fit):
        findings.append(finding("search-on-fitted-plant", "rc"))
    else:
        several = draw(fit, options.plants or 16, options.seed)
        drawn = list(several.plants)
        findings += several.findings
    model = model_of(fit)
    bounds = bounds_of(fit, settled.levels, settled.widen)
    points = operating_points(fit, model, plant, bounds, settled.duty_limits_pct)
    evaluations = options.evaluations or 240
    with progress("candidates", evaluations) as tick:
        best, before, after = optimize(
            model, bounds, settled, [plant_parameters(each) for each in drawn], points, wanted, noise,
            options.chatter_limit, evaluations, options.seed, tick,
        )  # fmt: skip
    result = Optimized(
        reference=name, plants=len(drawn), noise_nm=noise, noise_source=source, before=before, after=after,
        limit_pct=before.mean_abs_duty_step_pct if options.chatter_limit is None else options.chatter_limit,
    )  # fmt: skip
    return best, result, findings


def _replayed(
    gains: Gains, plant: Nonlinear | None, wanted: Reference, name: str, given: bool, dead_time_s: float
) -> tuple[Gains, list[Finding]]:
    """The replayed errors beside the ultimate bound, and the verdict with the slope of what was replayed."""
    if plant is None:
        return gains, [finding("nothing-to-replay-on", "model")]
    rc, pi, part = rc_gains(gains), pi_gains(gains), gains.rc
    assert rc is not None and pi is not None and part is not None and part.ultimate_bound is not None
    assert gains.guarantee is not None
    findings = []
    most, highest = float(wanted.torque_nm.max()), float(steady_torque(plant, plant.u_range[1]))
    if most > highest:
        findings.append(
            finding("reference-beyond-plant", "model", reference=name, asked=most, highest=highest,
                    unit=gains.output_unit)
        )  # fmt: skip
    rig = Rig(delay_samples=round(dead_time_s / wanted.dt_s))
    by_rc, by_pi = (replayed(plant, each, wanted, rig) for each in (rc_controller(rc), pi_controller(pi)))
    slope, Q_M = wanted.steepest_nm_s, part.Q_M
    assert Q_M is not None
    if not given and slope > Q_M * (1 + 1e-9):
        findings.append(finding("slope-above-q-max", "rc", slope=slope, Q_M=Q_M, reference=name))
    bound = msgspec.structs.replace(part.ultimate_bound, replayed_nm=by_rc.max_abs_error_nm)
    return msgspec.structs.replace(
        gains, rc=msgspec.structs.replace(part, ultimate_bound=bound),
        replayed=Replayed(name, slope, wanted.counted_from_s, by_rc, by_pi),
        guarantee=_judged(gains.guarantee, slope),
    ), findings  # fmt: skip


def _judged(verdict: Guarantee, slope: float) -> Guarantee:
    """The verdict with the slope [output/s] of what was replayed."""
    rows = {each.name: each for each in verdict.conditions}
    rows["Q_M"] = condition("Q_M", slope, rows["Q_M"].available, rows["Q_M"].unit)
    return guarantee(tuple(rows.values()))
