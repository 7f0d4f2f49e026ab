"""Controllers on the fitted plant: a scenario, a reference, the rehabilitation, or recorded runs; one function."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields

import msgspec
import numpy as np

from eaid.arrays import Array
from eaid.control.defaults import Scales, input_limits, is_duty, scales_of
from eaid.control.gains import pi_gains, rc_gains
from eaid.control.plant import plant_of, recorded_falls, why_not
from eaid.errors import DataError, UsageError
from eaid.findings import Finding, finding, ranked
from eaid.limits import MOST_STEPS, check_all
from eaid.logs.run import Run
from eaid.models.parameters import Linear, Nonlinear
from eaid.progress import Progress, no_progress
from eaid.replay import recorded as log
from eaid.replay.best import best as best_of
from eaid.replay.controllers import Controller, Knowledge, controller
from eaid.replay.guarantee import watch
from eaid.replay.loop import replay
from eaid.replay.montecarlo import QUANTILES, montecarlo
from eaid.replay.plant import PlantParameters, perturbed, plant_parameters, plant_terms
from eaid.replay.references import Reference, sampled
from eaid.replay.rehab import MODES, Rehabilitation, rehabilitate
from eaid.replay.rehab_statistics import record as record_session
from eaid.replay.residual_noise import residual_noise
from eaid.replay.rig import Rig
from eaid.replay.scenarios import SCENARIOS, Wish, measure, record
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.replay import Exercise, Head, Record, Replay, RigRecord
from eaid.uncertainty.draw import draw, drawable

Signal = tuple[Array, Array]
"""Time [s] and output, shapes (n,) each."""
UNSEEN = 0.01
"""Share of the samples that may lie outside what was identified without a word."""


@dataclass(frozen=True)
class SimulateOptions:
    """What `simulate` may be told; a field that is out of its limits raises `UsageError`."""

    scenario: str | None = None
    """steps, multisine, sweep or rehab; None: multisine, where neither a reference nor runs are given."""
    controllers: tuple[str, ...] | None = None
    """None: rc and pi where there are gains; the sweep adds open-loop."""
    duration: float | None = None
    """Length of steps, multisine or rehab [s]."""
    rate_hz: float | None = None
    """Control rate; None: 1000 Hz, on a rig that is not the paper's that of its logs."""
    rig: Rig = Rig()  # noqa: RUF009 - frozen
    residual_noise: bool = False
    """Noise as large and as coloured as the fit's residuals of one run."""
    perturb: Mapping[str, float] = field(default_factory=dict)
    """Factors on tau1, tau2 and Ts that the controllers do not know."""
    plants: int | None = None
    """Also on so many plants drawn from the fit's uncertainty."""
    threads: int | None = None
    best: bool = False
    """Also the least error that the plant allows, the future known."""
    limb_damping: float | None = None
    """Of the rehabilitation [N·m·s/rad]."""
    limb_inertia: float | None = None
    """[kg·m²]"""
    keep_baseline: bool = False
    """Do not subtract the idle output of recorded runs."""
    seed: int = 0

    def __post_init__(self) -> None:
        check_all(
            duration=self.duration, rate_hz=self.rate_hz, plants=self.plants, threads=self.threads, seed=self.seed,
            limb_damping=self.limb_damping, limb_inertia=self.limb_inertia,
        )  # fmt: skip
        if self.threads is not None and self.plants is None:
            raise UsageError("«threads»: does nothing without «plants»; give both or neither")
        if self.scenario != "rehab" and (self.limb_damping is not None or self.limb_inertia is not None):
            raise UsageError("«limb_damping» and «limb_inertia» belong to «scenario» rehab")
        if self.residual_noise and (self.rig.noise_nm > 0 or self.rig.noise_correlation_s > 0):
            raise UsageError("noise as the residuals sets the noise; leave out «noise_nm» and «noise_correlation_s»")
        if self.best and not self.rig.saturation:
            raise UsageError("«best»: is the best within the duty limits; leave out «no_saturation»")
        if self.rig.noise_correlation_s > 0 and not self.rig.noise_nm > 0 and not self.residual_noise:
            raise UsageError("«noise_correlation_s»: does nothing without «noise_nm»; give both or neither")

    def check_for(self, what: str) -> None:
        """Refuse what does nothing for a scenario, a `reference`, or recorded runs (`log`)."""
        tracks = what not in ("log", "rehab")
        if self.plants is not None and not tracks:
            raise UsageError("«plants»: goes with steps, multisine, sweep or «reference»; leave it out")
        if self.best and what == "rehab":
            raise UsageError("«best»: in rehab the reference depends on what the limb does; choose another scenario")
        if self.best and what == "log":
            raise UsageError("«best»: goes with a scenario or «reference»; leave it out")
        if self.duration is not None and what in ("log", "reference"):
            raise UsageError(f"«duration»: does not go with «{what}»; the file says how long it is")
        if self.keep_baseline and what != "log":
            raise UsageError("«keep_baseline»: belongs to «log»; leave it out")


@dataclass(frozen=True)
class _Setup:
    """What every kind of replay needs."""

    fit: Fit
    model: Nonlinear
    """The fitted plant, which the controllers know."""
    plant: PlantParameters
    """The one that is replayed."""
    known: Knowledge
    controllers: tuple[Controller, ...]
    rig: Rig
    options: SimulateOptions
    dt_s: float


def simulate(
    fit: Fit,
    gains: Gains | None = None,
    options: SimulateOptions = SimulateOptions(),
    reference: Signal | None = None,
    runs: Sequence[Run] | None = None,
    progress: Progress = no_progress,
) -> Replay:
    """Replay controllers on the fitted plant, from rest, and measure how well they track.

    Parameters
    ----------
    fit
        A fit with a nonlinear model, which is the plant.
    gains
        What `tune` made; the controllers rc and pi need it.
    options
        Scenario, controllers, the rig's own effects, plants to be drawn.
    reference
        A reference of the user's own, time [s] and output; in place of a scenario.
    runs
        Recorded runs whose own input is replayed, in place of a scenario; closed-loop ones are laid over.

    Raises
    ------
    DataError
        The fit holds no plant, or a run is in other units than the fit.
    UsageError
        Options that do nothing here, or contradict each other.
    """
    if sum(given is not None for given in (options.scenario, reference, runs)) > 1:
        raise UsageError("«scenario», «reference» and «log» exclude each other; give one of them")
    what = "log" if runs is not None else "reference" if reference is not None else options.scenario or "multisine"
    options.check_for(what)
    scales = scales_of(fit, plant_of(fit))
    setup, doubts = _setup(fit, gains, options, what, scales)
    if runs is not None:
        records, head, more = _logs(setup, runs)
    elif what == "rehab":
        records, head, more = _rehab(setup)
    else:
        wanted = _reference(setup, what, reference, scales)
        records, head, more = _scenario(setup, wanted, gains, progress)
    head = msgspec.structs.replace(
        head, scenario=what, seed=options.seed, input_unit=fit.data.input_unit, output_unit=fit.data.output_unit,
        rig=RigRecord(**asdict(setup.rig)), perturb=dict(options.perturb), synthetic=fit.data.synthetic,
        unidentified=_unidentified(fit, gains), findings=ranked([*doubts, *more]),
    )  # fmt: skip
    return Replay(head, records)


def _setup(
    fit: Fit, gains: Gains | None, options: SimulateOptions, what: str, scales: Scales
) -> tuple[_Setup, list[Finding]]:
    model = plant_of(fit)
    if model is None:
        raise DataError("the fit holds no nonlinear model, which the replay's plant is; fit clutch data with it")
    if gains is not None and (gains.input_unit, gains.output_unit) != (fit.data.input_unit, fit.data.output_unit):
        raise DataError(
            f"the gains are for an input in {gains.input_unit} and an output in {gains.output_unit}, the fit has "
            f"{fit.data.input_unit} and {fit.data.output_unit}; run tune-rc on this fit"
        )
    linear = fit.linear or (gains.model if gains is not None else None)
    known = Knowledge(
        model,
        None if linear is None else Linear(linear.a0, linear.b0, linear.c0),
        None if gains is None else rc_gains(gains),
        None if gains is None else pi_gains(gains),
        input_limits(fit) if gains is None else gains.duty_limits_pct,
    )
    names, told = _names(options.controllers, what, known)
    rig = options.rig
    if options.residual_noise:
        rig = Rig(**{**asdict(rig), **residual_noise(fit)})
    rate_hz = options.rate_hz or (1000.0 if scales.paper or is_duty(fit) else fit.data.sample_rate_hz or 1000.0)
    why = why_not(fit, "nonlinear")
    told += [finding("plant-not-identifiable", "nonlinear", why=why)] if why else []
    if gains is not None and gains.unidentified:
        told.append(finding("gains-not-identifiable", "gains", why=gains.unidentified))
    plant = plant_parameters(perturbed(model, options.perturb))
    chosen = tuple(controller(name, known) for name in names)
    return _Setup(fit, model, plant, known, chosen, rig, options, 1.0 / rate_hz), told


def _names(asked: tuple[str, ...] | None, what: str, known: Knowledge) -> tuple[tuple[str, ...], list[Finding]]:
    """The controllers to replay; by default those that the files allow."""
    if asked is not None:
        if not asked or len(set(asked)) < len(asked):
            raise UsageError(f"«controller» {','.join(asked)}: name each controller once, with commas between")
        straight = "open-loop" in asked and known.linear is None
        return asked, [finding("open-loop-on-straight-line", "open-loop")] if straight else []
    names = [name for name, held in (("rc", known.rc), ("pi", known.pi)) if held is not None]
    if what == "sweep" and known.linear is not None:
        names.append("open-loop")
    if names or what == "log":
        return tuple(names), []
    names = ["open-loop", "inverse"] if known.linear is not None else ["inverse"]
    return tuple(names), [finding("no-gains", "controllers")]


def _unidentified(fit: Fit, gains: Gains | None) -> dict[str, str]:
    """What of a replay stands on a fit that its data do not determine, and why."""
    told = {"plant": why_not(fit, "nonlinear"), "gains": gains.unidentified if gains is not None else ""}
    return {name: why for name, why in told.items() if why}


def _reference(setup: _Setup, what: str, signal: Signal | None, scales: Scales) -> Reference:
    """The scenario's reference at the rig's own scale, or the user's own."""
    if signal is not None:
        return sampled(*signal, setup.dt_s)
    if what not in SCENARIOS:
        raise UsageError(f"no scenario {what!r}; there are {', '.join(SCENARIOS)}, rehab")
    return SCENARIOS[what].reference(setup.dt_s, Wish(setup.options.duration, scales.top, scales.pace))


Outcome = tuple[dict[str, Record], Head, list[Finding]]


def _scenario(setup: _Setup, wanted: Reference, gains: Gains | None, progress: Progress) -> Outcome:
    """Each controller on the reference; the guarantee watched along the robust one; plants, and the best duty."""
    options, records = setup.options, {}
    told = _doubts(setup, wanted, gains)
    begin = round(wanted.counted_from_s / wanted.dt_s)
    for each in setup.controllers:
        trace = replay(setup.plant, each, wanted.torque_nm, setup.rig, wanted.dt_s, options.seed)
        measured, columns = measure(trace, wanted), {}
        if each.name == "rc":
            watched = watch(each.gains, setup.plant, trace)
            measured = watched.measured(measured, begin)
            columns = {"chi_nm_s": watched.chi_nm_s, "rho_nm_s": watched.rho_nm_s}
        records[each.name] = record(trace, measured, columns)
    told += _unseen(setup, records)
    head = Head("", dt_s=wanted.dt_s, counted_from_s=wanted.counted_from_s)
    if options.plants is not None:
        head, more = _spread(setup, wanted, records, head, progress)
        told += more
    if options.best:
        told += _best(setup, wanted, records)
    return records, head, told


def _doubts(setup: _Setup, wanted: Reference, gains: Gains | None) -> list[Finding]:
    """Where a reference asks for more than the plant has, or is steeper than Q_M."""
    told = []
    top, highest = float(wanted.torque_nm.max()), plant_terms(setup.plant, setup.plant.u_high)[2]
    if top > highest:
        told.append(
            finding("reference-above-plant", "reference", asked=top, highest=highest, unit=setup.fit.data.output_unit)
        )
    Q_M = gains.rc.Q_M if gains is not None and gains.rc is not None else None
    if Q_M is not None and not wanted.steps:
        slope = float(np.abs(np.gradient(wanted.torque_nm, wanted.dt_s)).max())
        if slope > Q_M * (1 + 1e-9):
            told.append(finding("reference-above-q-max", "rc", slope=slope, Q_M=Q_M))
    return told


def _unseen(setup: _Setup, records: Mapping[str, Record]) -> list[Finding]:
    """Where replays go through what no log showed: duties outside the identified ones, falls between levels."""
    low, high = setup.model.u_range
    below = above = falling = 0.0
    for one in records.values():
        duty, torque = one.columns["duty_pct"], one.columns["torque_nm"]
        falls = (np.diff(torque) < 0) & (duty[:-1] >= low)
        below = max(below, float(((duty > 0) & (duty < low)).mean()))
        above = max(above, float((duty > high).mean()))
        falling = max(falling, float(falls.mean()))
    seen = bool(recorded_falls(setup.fit))
    if max(below, above, 0.0 if seen else falling) <= UNSEEN:
        return []
    return [
        finding(
            "replay-leaves-identified", "nonlinear", below_pct=100 * below, above_pct=100 * above,
            falling_pct=None if seen else 100 * falling, low=low, high=high, unit=setup.fit.data.input_unit,
        )
    ]  # fmt: skip


def _spread(
    setup: _Setup, wanted: Reference, records: dict[str, Record], head: Head, progress: Progress
) -> tuple[Head, list[Finding]]:
    """Every metric over plants drawn from the fit's uncertainty, beside the fitted plant's."""
    options = setup.options
    count = options.plants or 0
    if count * len(wanted.torque_nm) > MOST_STEPS:
        raise UsageError(
            f"«plants» {count}: over {len(wanted.torque_nm):,} samples each, more than {MOST_STEPS:,} in all; ask for "
            f"{MOST_STEPS // len(wanted.torque_nm):,} at most, or a shorter «duration»"
        )
    without = not drawable(setup.fit)
    drawn = draw(setup.fit, count, options.seed)
    plants = [perturbed(plant, options.perturb) for plant in drawn.plants]
    for each in setup.controllers:
        with progress(f"{each.name} on drawn plants", count) as tick:
            found = montecarlo(plants, each, wanted, setup.rig, options.seed, options.threads, tick)
        kept = records[each.name]
        tables = {
            "plants/band_time_s": found.band_time_s,
            "plants/band_nm": found.band_nm,
            **{f"plants/metrics/{metric}": values for metric, values in found.values.items()},
            **{
                f"plants/parameters/{part}": np.array([getattr(p, part) for p in plants])
                for part in ("tau1", "tau2", "Ts")
            },
        }
        metrics = msgspec.structs.replace(kept.metrics, plants=found.summary(plants))
        records[each.name] = Record(kept.columns, metrics, tables)
    head = msgspec.structs.replace(
        head, plants=count, plants_from="fitted-plant" if without else "covariance", band_quantiles=QUANTILES
    )
    return head, [finding("plants-all-alike", "nonlinear")] if without else list(drawn.findings)


def _best(setup: _Setup, wanted: Reference, records: dict[str, Record]) -> list[Finding]:
    """The least error, kept as a group `best`; each controller is told how far it is from it."""
    bare = Rig(saturation=setup.rig.saturation)
    found = best_of(setup.plant, wanted, setup.known.limits)
    trace = found.trace(setup.known.limits)
    measured = msgspec.structs.replace(
        measure(trace, wanted), rms_error_nm=found.rms_error_nm, bound_rms_nm=found.bound_nm,
        steady_rms_nm=found.steady_rms_nm,
    )  # fmt: skip
    least = found.rms_error_nm
    for name, one in records.items():
        rms = one.metrics.rms_error_nm or 0.0
        metrics = msgspec.structs.replace(
            one.metrics, rms_over_best=rms / least if least > 1e-9 else None, rms_above_best_nm=rms - least
        )
        records[name] = Record(one.columns, metrics, one.tables, one.role)
    kept = record(trace, measured)
    records["best"] = Record(kept.columns, measured, role="best")
    return [finding("best-without-rig", "best")] if setup.rig != bare else []


def _rehab(setup: _Setup) -> Outcome:
    """The rehabilitation of §VII with each controller."""
    options = setup.options
    if setup.fit.data.output_unit not in ("N·m", "Nm"):
        raise DataError(f"rehab needs a torque, and the fit's output is in {setup.fit.data.output_unit}")
    said = {
        "mode_s": None if options.duration is None else options.duration / len(MODES),
        "damping_nms": options.limb_damping,
        "inertia_kgm2": options.limb_inertia,
    }
    exercise = Rehabilitation(**{key: value for key, value in said.items() if value is not None})
    records = {
        each.name: record_session(rehabilitate(setup.plant, each, exercise, setup.rig, setup.dt_s, options.seed))
        for each in setup.controllers
    }
    kept = {one.name: getattr(exercise, one.name) for one in fields(exercise)}
    return records, Head("", dt_s=setup.dt_s, counted_from_s=exercise.uncounted_s, exercise=Exercise(**kept)), []


def _logs(setup: _Setup, runs: Sequence[Run]) -> Outcome:
    """Recorded runs: their input through the plant, and over closed-loop runs the controllers replayed."""
    data = setup.fit.data
    beside = [
        log.recorded(run, setup.plant, setup.options.keep_baseline, (data.input_unit, data.output_unit)) for run in runs
    ]
    records: dict[str, Record] = {}
    for run in beside:
        # The model's torque is compared with the recorded one, which stands where a replay has its reference.
        columns = {
            "time_s": run.time_s, "reference_nm": run.recorded_nm, "torque_nm": run.model_nm, "duty_pct": run.duty_pct,
        }  # fmt: skip
        records[run.name] = Record(columns, log.difference(run), role="recorded-input")
    closed = [run for run in beside if run.reference_nm is not None]
    for run in closed:
        before = f"{run.name} " if len(closed) > 1 else ""
        assert run.reference_nm is not None
        columns = {
            "time_s": run.time_s, "reference_nm": run.reference_nm, "torque_nm": run.recorded_nm,
            "duty_pct": run.duty_pct,
        }  # fmt: skip
        measured = log.closed_loop_metrics(run, setup.known.limits)
        records[f"{before}recorded"] = Record(columns, measured, role="recorded-loop")
        wanted = log.reference_of(run)
        for each in setup.controllers:
            trace = log.laid_over(run, setup.plant, each, setup.rig, setup.options.seed)
            records[f"{before}{each.name}"] = record(trace, log.against(run, trace, measure(trace, wanted)))
    return records, Head(""), []
