"""Controllers on the fitted plant: a scenario, a reference, the rehabilitation, or recorded runs; one function."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import msgspec
import numpy as np

from eaid.control.defaults import control_rate, input_limits, of_this_mounting, scales_of
from eaid.control.gains import plant_of, refuse_other_units
from eaid.declared import part
from eaid.errors import DataError, UsageError
from eaid.estimate.draw import draw, drawable
from eaid.findings import Finding, finding, merged, ranked
from eaid.logs.run import Run
from eaid.options import RigExtras, SimulateOptions
from eaid.plant.dynamics import Plant, PlantNumbers, plant_numbers
from eaid.progress import Progress, no_progress
from eaid.replay.compare import compared, without_creep
from eaid.replay.controllers import Controller, OwnGains, OwnLaw, controller_of, own_step, why_no_inverse
from eaid.replay.loop import replay
from eaid.replay.metrics import lay_at_limit, measure
from eaid.replay.references import Reference, reference_beyond, reference_of, signal_of
from eaid.replay.rehab import MODES, rehabilitate
from eaid.replay.tune import unknown_to_plant
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.replay import Exercise, Head, Record, Replay
from eaid.results.verdict import PLANT_MODELS

UNSEEN_SHARE = 0.01  # Share of the samples that may lie outside what was identified without a word
# Records by name, what the head says of them, and findings
Outcome = tuple[dict[str, Record], dict[str, Any], list[Finding]]


def simulate(
    fit: Fit,
    gains: Gains | None,
    options: SimulateOptions,
    reference: Any = None,
    runs: Sequence[Run] | None = None,
    progress: Progress = no_progress,
    own: Mapping[str, OwnLaw] = MappingProxyType({}),
    one_run: bool = False,
) -> Replay:
    """`eaid.simulate` on what has been read: a reference as `signal_of` takes it, or recorded runs; a user's `own`
    controllers; drawn plants as a mean run has them, or `one_run` that scatters beside it. DataError where the fit
    holds no plant or a run has other units than the fit, UsageError where options do nothing here or contradict each
    other."""
    what = "log" if runs is not None else "reference" if reference is not None else options.scenario or "multisine"
    options.check_for("function" if callable(reference) else what)
    if own and (options.plants is not None or what == "log"):
        raise UsageError("a «controller» of your own does not go with «plants» or «log»; leave one of them out")
    model = plant_of(fit)
    if model is None:
        raise DataError("the fit holds no nonlinear model, which the replay's plant is; fit clutch data with it")
    refuse_other_units(fit, gains)
    controllers, findings = _controllers(fit, gains, model, options.controller or (), what, own)
    rig, scales = part(RigExtras, options), scales_of(fit, model)
    if runs is not None and (unused := list(rig.given())):
        raise UsageError(f"«{unused[0]}»: does nothing with logs; leave it out")
    made_for = gains.margins.timing.rate_hz if gains is not None and gains.margins is not None else None
    rate_hz = options.rate_hz or made_for or control_rate(fit)
    if fit.dead_time_s > 0:
        findings.append(finding("dead-time-replayed", "nonlinear", dead_time_s=fit.dead_time_s))
    reasons = {"plant": fit.verdict.of(*PLANT_MODELS).sentence, "gains": None if gains is None else gains.not_usable}
    not_usable = {name: why for name, why in reasons.items() if why}
    findings += [finding("replay-not-usable", name, why=why) for name, why in not_usable.items()]
    findings += [*unknown_to_plant(fit), *(of_this_mounting(fit, "errors") if runs is None else ())]
    if model.excess and runs is None:  # a controller's input moves all the time, and falls to no level
        findings.append(finding("replay-no-hysteresis", "nonlinear", excess_pct=100 * model.excess))
    plant, dt_s = plant_numbers(model), 1.0 / rate_hz
    outcome: Outcome
    if runs is not None:
        outcome = {run.name: compared(run, fit, model) for run in runs}, {}, []
        if any(without_creep(run, fit) is not run for run in runs):
            findings.append(finding("log-without-creep", "data"))
        findings += merged([one for run in runs for one in run.findings if one.code == "rows-dropped"])
    elif what == "rehab":
        outcome = _rehabilitated(fit, plant, controllers, scales.top, rig, options, dt_s)
    else:
        signal = None if reference is None else signal_of(reference, dt_s, options.duration)
        wanted = reference_of(what if signal is None else signal, dt_s, scales, options.duration)
        outcome = _tracked(fit, gains, plant, controllers, wanted, rig, options, progress, one_run)
    records, head, more = outcome
    return Replay(
        Head(
            what, seed=options.seed, input_unit=fit.data.input_unit, output_unit=fit.data.output_unit, rig=rig,
            synthetic=fit.data.synthetic, not_usable=not_usable, findings=ranked([*findings, *more]), **head,
        ),
        records,
    )  # fmt: skip


def _controllers(
    fit: Fit, gains: Gains | None, model: Plant, names: tuple[str, ...], what: str, own: Mapping[str, OwnLaw]
) -> tuple[tuple[Controller, ...], list[Finding]]:
    """The controllers that are named, else those of the gains, else what needs none; and a user's own."""
    findings = list[Finding]()
    linear = fit.linear.parameters if fit.linear is not None else gains.model if gains is not None else None
    if not names and not own:
        names = (*(gains.laws if gains is not None else ()), *("open-loop",) * (what == "sweep" and linear is not None))
        if not names and what != "log":
            names = ("open-loop",) * (linear is not None) + ("inverse",) * (not why_no_inverse(model))
            findings.append(finding("no-gains", "controllers"))
    limits = input_limits(fit) if gains is None else gains.duty_limits_pct
    controllers = [controller_of(name, model, linear, gains, limits) for name in names]
    controllers += [Controller(name, own_step, OwnGains(name, law, *limits)) for name, law in own.items()]
    return tuple(controllers), findings


def _rehabilitated(
    fit: Fit, plant: PlantNumbers, controllers: Sequence[Controller], top: float, rig: RigExtras,
    options: SimulateOptions, dt_s: float,
) -> Outcome:  # fmt: skip
    """The rehabilitation under each controller, at the rig's own torques."""
    if fit.data.output_unit not in ("N·m", "Nm"):
        raise DataError(f"rehab needs a torque, and the fit's output is in {fit.data.output_unit}")
    mode_s = None if options.duration is None else options.duration / len(MODES)
    given = {"mode_s": mode_s, "damping_nms": options.limb_damping}
    exercise = msgspec.structs.replace(
        Exercise().scaled(top), **{key: value for key, value in given.items() if value is not None}
    )
    sessions = {each.name: rehabilitate(plant, each, exercise, rig, dt_s, options.seed) for each in controllers}
    return sessions, {"dt_s": dt_s, "counted_from_s": exercise.uncounted_s, "exercise": exercise}, []


def _tracked(
    fit: Fit, gains: Gains | None, plant: PlantNumbers, controllers: Sequence[Controller], wanted: Reference,
    rig: RigExtras, options: SimulateOptions, progress: Progress, one_run: bool,
) -> Outcome:  # fmt: skip
    """Each controller on the reference; and on drawn plants, of a mean run or of `one_run` that scatters beside it."""
    seed, records = options.seed, {}
    findings = reference_beyond(wanted, plant, "reference", fit.data.output_unit)
    Q_M = gains.rc.Q_M if gains is not None and gains.rc is not None else None
    if Q_M is not None and not wanted.steps and wanted.steepest_nm_s > Q_M * (1 + 1e-9):
        findings.append(finding("reference-above-q-max", "rc", slope=wanted.steepest_nm_s, Q_M=Q_M))
    for controller in controllers:
        columns = replay(plant, controller, wanted.torque_nm, rig, wanted.dt_s, seed)
        records[controller.name] = Record(columns, measure(columns, controller.limits_pct, wanted))
        findings += lay_at_limit(controller.name, columns, controller.limits_pct)
    findings += _outside_identified(fit, plant, records)
    head: dict[str, Any] = {"dt_s": wanted.dt_s, "counted_from_s": wanted.counted_from_s}
    if (count := options.plants) is None:
        return records, head, findings

    from eaid.replay.many import QUANTILES, montecarlo  # numba, which a replay of one plant does without

    drawn = draw(fit, count, seed)
    if one_run and fit.uncertainty is not None and fit.uncertainty.noise is not None:
        sd, random = fit.uncertainty.noise.scatter.get("Ts", 0.0), np.random.default_rng(seed + 1)
        plants = tuple(p.scaled(float(np.exp(sd * random.standard_normal()))) for p in drawn.plants)
        drawn = replace(drawn, plants=plants)
    findings += list(drawn.findings) if drawable(fit) else [finding("plants-all-alike", "nonlinear")]
    parameters = {
        f"plants/parameters/{name}": np.array([getattr(each, name) for each in drawn.plants])
        for name in ("tau1", "tau2", "Ts")
    }
    for controller in controllers:
        with progress(f"{controller.name} on drawn plants", count) as tick:
            spread, tables = montecarlo(drawn.plants, controller, wanted, rig, seed, tick)
        alone = records[controller.name]
        metrics = msgspec.structs.replace(alone.metrics, plants=spread)
        records[controller.name] = Record(alone.columns, metrics, tables | parameters)
    return records, {**head, "plants": count, "band_quantiles": QUANTILES}, findings


def _outside_identified(fit: Fit, plant: PlantNumbers, records: Mapping[str, Record]) -> list[Finding]:
    """Where replays go through what no log showed: duties outside the identified ones, falls between levels."""
    low, high = 0.0 if plant.signed else plant.u_low, plant.u_high  # between both signs lies what was recorded
    shares = [(0.0, 0.0, 0.0)]
    for replayed in records.values():
        size, output = (np.abs(replayed.columns[name]) for name in ("duty_pct", "torque_nm"))
        falls = (np.diff(output) < 0) & (size[:-1] >= plant.u_low)
        shares.append((float(((size > 0) & (size < low)).mean()), float((size > high).mean()), float(falls.mean())))
    below, above, falling = map(max, zip(*shares, strict=True))
    falls_known = fit.falls_recorded
    if max(below, above, 0.0 if falls_known else falling) <= UNSEEN_SHARE:
        return []
    return [
        finding(
            "replay-leaves-identified", "nonlinear", below_pct=100 * below, above_pct=100 * above,
            falling_pct=None if falls_known else 100 * falling, low=low, high=high, unit=fit.data.input_unit,
        )
    ]  # fmt: skip
