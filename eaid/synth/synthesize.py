"""Synthetic logs of a plant, from options alone: steps, a given input or an excitation; one function.

A run of a step idles, holds its level, and is released.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import TypeVar

import numpy as np

from eaid.declared import keyed
from eaid.errors import UsageError
from eaid.logs.run import Run
from eaid.options import EXPERIMENTS, InputOptions, SynthOptions
from eaid.results.fit import Fit
from eaid.synth.excitation import synthesise_excitation
from eaid.synth.files import read_input
from eaid.synth.logs import NONE, Disturbance, InputSteps, as_run, mark, refuse_too_many, render, scatter
from eaid.synth.plants import REFERENCE, Specimen, of_model

# Disturbances in the output's unit: their defaults are scaled to the rig
ABSOLUTE = ("white_nm", "offset_nm", "resolution_nm")


@dataclass(frozen=True)
class Protocol:
    """How an experiment is recorded, as the options of the same names; each level [%, N or RPM] is a run of its own,
    and without a release the log ends with the input held."""

    levels: tuple[float, ...]
    repeats: int = 3
    idle_s: float = 10.0
    hold_s: float = 20.0
    release_s: float = 10.0
    rate_hz: float = 1000.0


def usual_protocol(plant: Specimen) -> Protocol:
    """How a kind of experiment is recorded by itself: all of the plant's levels."""
    if plant.kind == "clutch":
        return Protocol(plant.levels)
    return Protocol(plant.levels, repeats=2, idle_s=2.0, hold_s=60.0, release_s=0.0)


PlantPart = TypeVar("PlantPart", Protocol, Disturbance)


def synthesize(options: SynthOptions, fit: Fit | None = None, named: str = "a fit") -> list[Run]:
    """What `eaid.synth` calls: runs as a rig would have recorded them; a fit is called `named` in them.

    UsageError for what cannot be recorded; DataError where the fit holds no plant, or a file is no such table.
    """
    plant = REFERENCE[options.kind or "clutch"] if fit is None else of_model(fit, options.kind or fit.data.kind, named)
    disturbance = disturbance_of(options, plant)
    protocol = said_by(options, usual_protocol(plant))
    if options.duty_file is not None:
        changes, duration_s = read_input(options.duty_file, plant.kind, plant.input_unit)
        timing = replace(protocol, idle_s=0.0, hold_s=duration_s, release_s=0.0)
        check_protocol(plant, timing)
        return list(repeats(plant, "input", changes, duration_s, timing, disturbance, (options.seed, len(EXPERIMENTS))))
    if options.excitation is not None:
        rate = {} if options.rate_hz is None else {"rate_hz": options.rate_hz}
        shape = keyed(InputOptions, "«shape»", options.shape, kind=options.excitation, **rate)
        return synthesise_excitation(plant, shape, disturbance, options.seed, options.repeats or 1)
    return stepped(plant, protocol, disturbance, options.seed)


def stepped(plant: Specimen, protocol: Protocol, disturbance: Disturbance, seed: int) -> list[Run]:
    """Runs of idle, step, hold and release; the seed, the place of a level and the repeat make a run."""
    check_protocol(plant, protocol)
    p, end_s, runs = protocol, protocol.idle_s + protocol.hold_s, []
    for place, level in enumerate(map(float, p.levels)):
        changes = [(0.0, 0.0)] * (p.idle_s > 0) + [(p.idle_s, level), (end_s, 0.0)]
        wide = f"{level:05.1f}"  # so that names sort, where a tenth tells the level exactly
        name = wide if float(wide) == level else f"{level:.9g}"
        key = seed, EXPERIMENTS.index(plant.kind), place
        made = repeats(plant, name, changes, end_s + p.release_s, p, disturbance, key)
        runs += [replace(run, level=level, step_s=p.idle_s) for run in made]
    return runs


def repeats(
    plant: Specimen, what: str, changes: InputSteps, duration_s: float, protocol: Protocol, disturbance: Disturbance,
    key: tuple[int, ...],
) -> Iterator[Run]:  # fmt: skip
    """The runs of one input, each of a rig that was at rest before; key, the seed first, and repeat make its noise."""
    starts, levels = np.array(changes).T
    time_s = np.arange(round(duration_s * protocol.rate_hz)) / protocol.rate_hz
    for repeat in range(1, protocol.repeats + 1):
        draw = np.random.default_rng([*key, repeat])
        columns = render(plant, scatter(disturbance, draw), (starts, levels), time_s, disturbance, draw)
        yield as_run(plant, columns, what, repeat, mark(plant, disturbance, key[0]))


def check_protocol(plant: Specimen, protocol: Protocol) -> None:
    """Refuse what cannot be recorded."""
    faults = []
    if not protocol.levels:
        faults.append("«levels»: give at least one level")
    if len(set(protocol.levels)) < len(protocol.levels):
        faults.append("«levels»: a level stands there twice; give each once and raise «repeats»")
    if plant.is_duty:
        faults += [f"«levels» {level:g}: a duty is at most 100 %" for level in protocol.levels if level > 100]
    if plant.kind != "clutch" and protocol.release_s > 0:
        faults.append("«release_s»: nobody has published how friction falls when weights are lifted; leave it at 0")
    if faults:
        raise UsageError(*faults)
    samples = (protocol.idle_s + protocol.hold_s + protocol.release_s) * protocol.rate_hz
    if protocol.hold_s * protocol.rate_hz < 10:
        raise UsageError(
            f"«hold_s» {protocol.hold_s:g}: fewer than 10 samples at {protocol.rate_hz:g} Hz; hold longer or raise "
            "«rate_hz»"
        )
    refuse_too_many(samples * protocol.repeats * len(protocol.levels))


def said_by(options: SynthOptions, usual: PlantPart) -> PlantPart:
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
