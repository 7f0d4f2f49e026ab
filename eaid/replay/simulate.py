"""Controllers on the fitted plant: a scenario, a reference, the rehabilitation, or recorded runs; one function."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from eaid.control.defaults import control_rate, input_limits, scales_of
from eaid.control.gains import plant_of, refuse_other_units
from eaid.declared import part
from eaid.errors import DataError, UsageError
from eaid.estimate.draw import draw, drawable
from eaid.findings import Finding, finding, ranked
from eaid.logs.run import Run
from eaid.models.parameters import Linear
from eaid.options import Rig, SimulateOptions
from eaid.progress import Progress, no_progress
from eaid.replay.compare import compared
from eaid.replay.controllers import CONTROLLERS, Controller, Knowledge
from eaid.replay.loop import replay
from eaid.replay.plant import PlantParameters, plant_parameters, plant_terms
from eaid.replay.references import Reference, Signal, measure, record, reference_of
from eaid.replay.rehab import MODES, rehabilitate
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.replay import Exercise, Head, Record, Replay
from eaid.results.verdict import PLANT


@dataclass(frozen=True)
class Setup:
    """What every kind of replay needs."""

    fit: Fit
    plant: PlantParameters
    known: Knowledge  # Of the controllers: the fitted plant among it
    controllers: tuple[Controller, ...]
    rig: Rig
    options: SimulateOptions
    dt_s: float


def set_up(fit: Fit, gains: Gains | None, options: SimulateOptions, what: str) -> tuple[Setup, list[Finding]]:
    """What a fit, gains and options come to, and findings on them; DataError where the fit holds no plant."""
    model = plant_of(fit)
    if model is None:
        raise DataError("the fit holds no nonlinear model, which the replay's plant is; fit clutch data with it")
    refuse_other_units(fit, gains)
    linear = fit.linear or (gains.model if gains is not None else None)
    known = Knowledge(
        model,
        None if linear is None else Linear(linear.a0, linear.b0, linear.c0),
        gains,
        input_limits(fit) if gains is None else gains.duty_limits_pct,
    )
    names, findings = _names(options.controller, what, known)
    rig = part(Rig, options)
    made_for = gains.margins.timing.rate_hz if gains is not None and gains.margins is not None else None
    rate_hz = options.rate_hz or made_for or control_rate(fit)
    if fit.dead_time_s > 0 and rig.delay_samples == 0:
        rig = replace(rig, delay_samples=round(fit.dead_time_s * rate_hz))
        findings.append(finding("dead-time-replayed", "nonlinear", dead_time_s=fit.dead_time_s))
    for what_stands, why in _not_usable(fit, gains).items():
        findings.append(finding("replay-not-usable", what_stands, why=why))
    chosen = tuple(CONTROLLERS[name](known) for name in names)
    return Setup(fit, plant_parameters(model), known, chosen, rig, options, 1.0 / rate_hz), findings


def _names(wanted: tuple[str, ...] | None, what: str, known: Knowledge) -> tuple[tuple[str, ...], list[Finding]]:
    """The controllers to replay; by default those that the files allow."""
    if wanted:
        return wanted, []
    names = list(known.gains.laws) if known.gains is not None else []
    if what == "sweep" and known.linear is not None:
        names.append("open-loop")
    if names or what == "log":
        return tuple(names), []
    names = ["open-loop", "inverse"] if known.linear is not None else ["inverse"]
    return tuple(names), [finding("no-gains", "controllers")]


UNSEEN = 0.01  # Share of the samples that may lie outside what was identified without a word
Outcome = tuple[dict[str, Record], Head, list[Finding]]


def tracked(setup: Setup, wanted: Reference, gains: Gains | None, progress: Progress) -> Outcome:
    """Each controller on the reference; and drawn plants."""
    options, records = setup.options, {}
    findings = _of_reference(setup, wanted, gains)
    for controller in setup.controllers:
        trace = replay(setup.plant, controller, wanted.torque_nm, setup.rig, wanted.dt_s, options.seed)
        records[controller.name] = record(trace, measure(trace, wanted))
    findings += _outside_identified(setup, records)
    head = Head("", dt_s=wanted.dt_s, counted_from_s=wanted.counted_from_s)
    if options.plants is not None:
        head, of_plants = _over_drawn_plants(setup, wanted, records, head, progress)
        findings += of_plants
    return records, head, findings


def _of_reference(setup: Setup, wanted: Reference, gains: Gains | None) -> list[Finding]:
    """Where a reference asks for more than the plant has, or is steeper than Q_M."""
    findings = []
    top, highest = float(wanted.torque_nm.max()), plant_terms(setup.plant, setup.plant.u_high)[2]
    if top > highest:
        findings.append(
            finding("reference-above-plant", "reference", asked=top, highest=highest, unit=setup.fit.data.output_unit)
        )
    Q_M = gains.rc.Q_M if gains is not None and gains.rc is not None else None
    if Q_M is not None and not wanted.steps and wanted.steepest_nm_s > Q_M * (1 + 1e-9):
        findings.append(finding("reference-above-q-max", "rc", slope=wanted.steepest_nm_s, Q_M=Q_M))
    return findings


def _outside_identified(setup: Setup, records: Mapping[str, Record]) -> list[Finding]:
    """Where replays go through what no log showed: duties outside the identified ones, falls between levels."""
    low, high = setup.known.plant.u_range
    below = above = falling = 0.0
    for replayed in records.values():
        duty, torque = replayed.columns["duty_pct"], replayed.columns["torque_nm"]
        falls = (np.diff(torque) < 0) & (duty[:-1] >= low)
        below = max(below, float(((duty > 0) & (duty < low)).mean()))
        above = max(above, float((duty > high).mean()))
        falling = max(falling, float(falls.mean()))
    falls_known = bool(setup.fit.recorded_falls)
    if max(below, above, 0.0 if falls_known else falling) <= UNSEEN:
        return []
    return [
        finding(
            "replay-leaves-identified", "nonlinear", below_pct=100 * below, above_pct=100 * above,
            falling_pct=None if falls_known else 100 * falling, low=low, high=high, unit=setup.fit.data.input_unit,
        )
    ]  # fmt: skip


def _over_drawn_plants(
    setup: Setup, wanted: Reference, records: dict[str, Record], head: Head, progress: Progress
) -> tuple[Head, list[Finding]]:
    """Every metric over plants drawn from the fit's uncertainty, beside the fitted plant's."""
    from eaid.replay.many import QUANTILES, montecarlo  # numba, which a replay of one plant does without

    options = setup.options
    count = options.plants or 0
    all_alike = not drawable(setup.fit)
    drawn = draw(setup.fit, count, options.seed)
    parameters = {name: np.array([getattr(plant, name) for plant in drawn.plants]) for name in ("tau1", "tau2", "Ts")}
    for controller in setup.controllers:
        with progress(f"{controller.name} on drawn plants", count) as tick:
            spread, tables = montecarlo(drawn.plants, controller, wanted, setup.rig, options.seed, tick)
        tables |= {f"plants/parameters/{name}": values for name, values in parameters.items()}
        on_fitted = records[controller.name]
        metrics = msgspec.structs.replace(on_fitted.metrics, plants=spread)
        records[controller.name] = Record(on_fitted.columns, metrics, tables)
    head = msgspec.structs.replace(
        head, plants=count, plants_from="fitted-plant" if all_alike else "covariance", band_quantiles=QUANTILES
    )
    return head, [finding("plants-all-alike", "nonlinear")] if all_alike else list(drawn.findings)


def simulate(
    fit: Fit,
    gains: Gains | None = None,
    options: SimulateOptions = SimulateOptions(),  # noqa: B008 - frozen
    reference: Signal | None = None,
    runs: Sequence[Run] | None = None,
    progress: Progress = no_progress,
) -> Replay:
    """`eaid.simulate` on what has been read: a reference as time [s] and output, or recorded runs.

    Raises DataError where the fit holds no plant or a run has other units than the fit, UsageError where options do
    nothing here or contradict each other.
    """
    what = "log" if runs is not None else "reference" if reference is not None else options.scenario or "multisine"
    options.check_for(what)
    scales = scales_of(fit, plant_of(fit))
    setup, warned = set_up(fit, gains, options, what)
    if runs is not None:
        records, head, more = _logs(setup, runs)
    elif what == "rehab":
        records, head, more = _rehab(setup, scales.top)
    else:
        wanted = reference_of(what if reference is None else reference, setup.dt_s, scales, options.duration)
        records, head, more = tracked(setup, wanted, gains, progress)
    head = msgspec.structs.replace(
        head, scenario=what, seed=options.seed, input_unit=fit.data.input_unit, output_unit=fit.data.output_unit,
        rig=setup.rig, synthetic=fit.data.synthetic,
        not_usable=_not_usable(fit, gains), findings=ranked([*warned, *more]),
    )  # fmt: skip
    return Replay(head, records)


def _not_usable(fit: Fit, gains: Gains | None) -> dict[str, str]:
    """What of a replay stands on a fit that must not be used, and why."""
    reasons = {"plant": fit.verdict.of(*PLANT).sentence, "gains": (gains.not_usable or "") if gains is not None else ""}
    return {name: why for name, why in reasons.items() if why}


def _rehab(setup: Setup, top: float) -> Outcome:
    """The rehabilitation of §VII with each controller, its moments scaled to what the rig can hold."""
    options = setup.options
    if setup.fit.data.output_unit not in ("N·m", "Nm"):
        raise DataError(f"rehab needs a torque, and the fit's output is in {setup.fit.data.output_unit}")
    mode_s = None if options.duration is None else options.duration / len(MODES)
    given = {"mode_s": mode_s, "damping_nms": options.limb_damping}
    exercise = msgspec.structs.replace(
        Exercise().scaled(top), **{key: value for key, value in given.items() if value is not None}
    )
    records = {
        each.name: rehabilitate(setup.plant, each, exercise, setup.rig, setup.dt_s, options.seed)
        for each in setup.controllers
    }
    return records, Head("", dt_s=setup.dt_s, counted_from_s=exercise.uncounted_s, exercise=exercise), []


def _logs(setup: Setup, runs: Sequence[Run]) -> Outcome:
    """Recorded runs: their input through the plant."""
    if unused := list(part(Rig, setup.options).given()):
        raise UsageError(f"«{unused[0]}»: does nothing with logs; leave it out")
    fit = setup.fit
    units = fit.data.input_unit, fit.data.output_unit
    return {run.name: compared(run, setup.plant, units, fit.dead_time_s) for run in runs}, Head(""), []
