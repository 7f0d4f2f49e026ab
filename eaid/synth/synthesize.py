"""Synthetic logs of a plant, from options alone: protocol, given input or excitation; one function."""

from dataclasses import fields, replace

from eaid.control.gains import pi_gains, rc_gains
from eaid.declared import keyed
from eaid.errors import UsageError
from eaid.logs.run import Run
from eaid.options import Excitation, SynthOptions
from eaid.replay.controllers import Controller, pi_controller, rc_controller
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.synth.excitation import synthesise_excitation
from eaid.synth.files import read_input
from eaid.synth.logs import NONE, PROTOCOLS, Disturbance, Protocol, synthesise, synthesise_input
from eaid.synth.plants import REFERENCE, Plant, of_fit

ABSOLUTE = ("white_nm", "offset_nm", "resolution_nm")
"""Disturbances in the output's unit: their defaults are scaled to the rig."""


def synthesize(
    options: SynthOptions,
    fit: Fit | None = None,
    named: str = "a fit",
    gains: Gains | None = None,
) -> list[Run]:
    """Logs of a plant, as a rig would have recorded them.

    Parameters
    ----------
    options
        Levels, times, disturbances, or an input of the user's own.
    fit
        The plant; None: the reference plant of the kind (docs/synthetic.md).
    named
        What the logs call the fit.
    gains
        Whose controller drives a closed loop; None: the PI of the excitation.

    Raises
    ------
    UsageError
        What is asked for cannot be recorded.
    DataError
        The fit holds no plant, or a file is no such table.
    """
    if options.excitation != "closed-loop" and gains is not None:
        raise UsageError("«gains»: drive a closed loop; give «excitation» closed-loop with them, or leave them out")
    if options.controller != SynthOptions.controller and gains is None:
        raise UsageError(f"«controller» {options.controller}: is one of «gains»; give them, or leave it out")
    plant = REFERENCE[options.kind or "clutch"] if fit is None else of_fit(fit, options.kind or fit.data.kind, named)
    disturbance = disturbance_of(options, plant)
    given = {each.name: getattr(options, each.name) for each in fields(Protocol)}
    times = {name: value for name, value in given.items() if value is not None}
    protocol = replace(PROTOCOLS[plant.kind], **{"levels": plant.levels, **times})
    if options.duty_file is not None:
        changes, duration_s = read_input(options.duty_file, plant.kind, plant.input_unit)
        timing = replace(protocol, idle_s=0.0, hold_s=duration_s, release_s=0.0)
        return synthesise_input(plant, changes, timing, disturbance, options.seed)
    if options.excitation is not None:
        options_given = {"kind": options.excitation, "rate_hz": options.rate_hz}
        given = {name: value for name, value in options_given.items() if value is not None}
        shape = keyed(Excitation, "«shape»", options.shape, given)
        if gains is not None and shape.gains is not None:
            raise UsageError("«shape» gains and «gains» exclude each other; give one of them")
        return synthesise_excitation(
            plant, shape, disturbance, options.seed, options.repeats or 1, controller_of(gains, options)
        )
    return synthesise(plant, protocol, disturbance, options.seed)


def controller_of(gains: Gains | None, options: SynthOptions) -> Controller | None:
    """The controller of gains that drives a closed loop; `UsageError` where they hold none of that name."""
    if gains is None:
        return None
    rc, pi = rc_gains(gains), pi_gains(gains)
    if options.controller == "rc" and rc is not None:
        return rc_controller(rc)
    if options.controller == "pi" and pi is not None:
        return pi_controller(pi)
    raise UsageError(f"«controller» {options.controller}: the gains hold no such controller")


def disturbance_of(options: SynthOptions, plant: Plant) -> Disturbance:
    """What is not the plant: the defaults, in the output's own size where that is no torque in N·m."""
    base = NONE if options.clean else Disturbance()
    if not plant.in_nm:
        base = replace(base, **{name: getattr(base, name) * plant.scale for name in ABSOLUTE})
    given = {each.name: getattr(options, each.name) for each in fields(Disturbance)}
    disturbance = replace(base, **{name: value for name, value in given.items() if value is not None})
    if options.coloured_s is not None and not disturbance.coloured > 0:
        raise UsageError("«coloured_s»: does nothing without «coloured»; give both or neither")
    if disturbance.coloured > 0 and disturbance.coloured_s == 0:
        raise UsageError("«coloured_s» 0: coloured noise needs a time constant above 0; white noise is «white_nm»")
    return disturbance
