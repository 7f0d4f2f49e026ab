"""What every kind of replay needs: the plant, what the controllers know of it, the rig, the clock."""

from dataclasses import dataclass, replace

from eaid.control.defaults import Scales, input_limits, is_duty
from eaid.control.gains import pi_gains, rc_gains
from eaid.control.plant import plant_of, why_not
from eaid.errors import DataError, UsageError
from eaid.findings import Finding, finding
from eaid.models.parameters import Linear
from eaid.options import Rig, SimulateOptions
from eaid.replay.controllers import Controller, Knowledge, controller
from eaid.replay.noise import with_residual_noise
from eaid.replay.plant import PlantParameters, perturbed, plant_parameters
from eaid.results.fit import Fit
from eaid.results.gains import Gains


@dataclass(frozen=True)
class Setup:
    """What every kind of replay needs."""

    fit: Fit
    plant: PlantParameters
    """The plant that is replayed."""
    known: Knowledge
    """Of the controllers: the fitted plant among it."""
    controllers: tuple[Controller, ...]
    rig: Rig
    options: SimulateOptions
    dt_s: float


def set_up(
    fit: Fit, gains: Gains | None, options: SimulateOptions, what: str, scales: Scales
) -> tuple[Setup, list[Finding]]:
    """What a fit, gains and options come to, and findings on them; DataError where the fit holds no plant."""
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
        rc_gains(gains),
        pi_gains(gains),
        input_limits(fit) if gains is None else gains.duty_limits_pct,
    )
    names, findings = _names(options.controller, what, known)
    rig = with_residual_noise(options.rig, fit) if options.noise is not None else options.rig
    rate_hz = options.rate_hz or (1000.0 if scales.paper or is_duty(fit) else fit.data.sample_rate_hz or 1000.0)
    if fit.dead_time_s > 0 and rig.delay_samples == 0:
        rig = replace(rig, delay_samples=round(fit.dead_time_s * rate_hz))
        findings.append(finding("dead-time-replayed", "nonlinear", dead_time_s=fit.dead_time_s))
    why = why_not(fit, "nonlinear")
    findings += [finding("plant-not-identifiable", "nonlinear", why=why)] if why else []
    if gains is not None and gains.unidentified:
        findings.append(finding("gains-not-identifiable", "gains", why=gains.unidentified))
    plant = plant_parameters(perturbed(model, options.perturb))
    chosen = tuple(controller(name, known) for name in names)
    return Setup(fit, plant, known, chosen, rig, options, 1.0 / rate_hz), findings


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
