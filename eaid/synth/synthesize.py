"""Synthetic logs of a plant, from options alone: protocol, given input or excitation; one function."""

from dataclasses import fields, replace
from typing import TypeVar

from eaid.declared import keyed
from eaid.errors import UsageError
from eaid.logs.run import Run
from eaid.options import EXPERIMENTS, Excitation, SynthOptions
from eaid.results.fit import Fit
from eaid.synth.excitation import synthesise_excitation
from eaid.synth.files import read_input
from eaid.synth.logs import NONE, PROTOCOLS, Disturbance, Protocol, check_protocol, repeats, synthesise
from eaid.synth.plants import REFERENCE, Specimen, of_fit

Part = TypeVar("Part", Protocol, Disturbance)
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
    protocol = said_by(options, replace(PROTOCOLS[plant.kind], levels=plant.levels))
    if options.duty_file is not None:
        changes, duration_s = read_input(options.duty_file, plant.kind, plant.input_unit)
        timing = replace(protocol, idle_s=0.0, hold_s=duration_s, release_s=0.0)
        check_protocol(plant, timing)
        return list(repeats(plant, "input", changes, duration_s, timing, disturbance, (options.seed, len(EXPERIMENTS))))
    if options.excitation is not None:
        rate = {} if options.rate_hz is None else {"rate_hz": options.rate_hz}
        shape = keyed(Excitation, "«shape»", options.shape, {"kind": options.excitation, **rate})
        return synthesise_excitation(plant, shape, disturbance, options.seed, options.repeats or 1)
    return synthesise(plant, protocol, disturbance, options.seed)


def said_by(options: SynthOptions, usual: Part) -> Part:
    """The usual values, or those of the options of the same names."""
    given = {each.name: getattr(options, each.name, None) for each in fields(usual)}
    return replace(usual, **{name: value for name, value in given.items() if value is not None})


def disturbance_of(options: SynthOptions, plant: Specimen) -> Disturbance:
    """What is not the plant: the defaults, in the output's own size where that is no torque in N·m."""
    base = NONE if options.clean else Disturbance()
    if not plant.in_nm:
        base = replace(base, **{name: getattr(base, name) * plant.scale for name in ABSOLUTE})
    disturbance = said_by(options, base)
    if options.coloured_s is not None and not disturbance.coloured > 0:
        raise UsageError("«coloured_s»: does nothing without «coloured»; give both or neither")
    if disturbance.coloured > 0 and disturbance.coloured_s == 0:
        raise UsageError("«coloured_s» 0: coloured noise needs a time constant above 0; white noise is «white_nm»")
    return disturbance
