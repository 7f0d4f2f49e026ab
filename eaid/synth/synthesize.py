"""Synthetic logs of a plant, from options alone: protocol, given input or excitation; one function."""

from dataclasses import fields, replace

from eaid.declared import keyed
from eaid.errors import UsageError
from eaid.logs.run import Run
from eaid.options import Excitation, SynthOptions
from eaid.results.fit import Fit
from eaid.synth.excitation import synthesise_excitation
from eaid.synth.files import read_input
from eaid.synth.logs import NONE, PROTOCOLS, Disturbance, Protocol, synthesise, synthesise_input
from eaid.synth.plants import REFERENCE, Plant, of_fit

# Disturbances in the output's unit: their defaults are scaled to the rig
ABSOLUTE = ("white_nm", "offset_nm", "resolution_nm")


def synthesize(options: SynthOptions, fit: Fit | None = None, named: str = "a fit") -> list[Run]:
    """Logs of a plant, as a rig would have recorded them.

    Parameters
    ----------
    options
        Levels, times, disturbances, or an input of the user's own.
    fit
        The plant; None: the reference plant of the kind (docs/synthetic.md).
    named
        What the logs call the fit.

    Raises
    ------
    UsageError
        What is asked for cannot be recorded.
    DataError
        The fit holds no plant, or a file is no such table.
    """
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
        return synthesise_excitation(plant, shape, disturbance, options.seed, options.repeats or 1)
    return synthesise(plant, protocol, disturbance, options.seed)


def disturbance_of(options: SynthOptions, plant: Plant) -> Disturbance:
    """What is not the plant: the defaults, in the output's own size where that is no torque in N·m."""
    base = NONE if options.clean else Disturbance()
    if not plant.in_nm:
        base = replace(base, **{name: getattr(base, name) * plant.scale for name in ABSOLUTE})
    given = {each.name: getattr(options, each.name, None) for each in fields(Disturbance)}
    disturbance = replace(base, **{name: value for name, value in given.items() if value is not None})
    if options.coloured_s is not None and not disturbance.coloured > 0:
        raise UsageError("«coloured_s»: does nothing without «coloured»; give both or neither")
    if disturbance.coloured > 0 and disturbance.coloured_s == 0:
        raise UsageError("«coloured_s» 0: coloured noise needs a time constant above 0; white noise is «white_nm»")
    return disturbance
