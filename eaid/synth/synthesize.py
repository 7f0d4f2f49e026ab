"""Synthetic logs of a plant, from options alone: protocol, run table, given input or excitation; one function."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Literal

from eaid.control.gains import pi_gains, rc_gains
from eaid.errors import UsageError, unknown
from eaid.limits import check_all
from eaid.logs.run import Kind, Run
from eaid.replay.controllers import Controller, pi_controller, rc_controller
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.synth.disturbance import NONE, Disturbance
from eaid.synth.excitation import Excitation, synthesise_excitation
from eaid.synth.input import read_input, read_plan
from eaid.synth.logs import KINDS, PROTOCOLS, Protocol, synthesise, synthesise_input, synthesise_plan
from eaid.synth.plants import REFERENCE, Plant, of_fit

ABSOLUTE = ("white_nm", "offset_nm", "resolution_nm")
"""Disturbances in the output's unit: their defaults are scaled to the rig."""
OPTION = {"white_nm": "noise_nm"}
"""Disturbances whose option has another name."""


@dataclass(frozen=True)
class SynthOptions:
    """What `synthesize` may be told; a field that is out of its limits raises `UsageError`. None: the kind's own."""

    kind: Kind | None = None
    """None: the fit's, else clutch."""
    levels: tuple[float, ...] | None = None
    """In the input's unit."""
    repeats: int | None = None
    idle_s: float | None = None
    """Input 0 before the step [s]."""
    hold_s: float | None = None
    """Input at its level [s]."""
    release_s: float | None = None
    """Input 0 after the step [s]."""
    rate_hz: float | None = None
    """Samples a second [Hz]."""
    duty_file: Path | None = None
    """CSV of an input in place of steps."""
    plan: Path | None = None
    """Run table of `plan`."""
    excitation: str | None = None
    """staircase, random, prbs, multisine, chirp or closed-loop, in place of steps."""
    shape: Mapping[str, float | int | tuple[float, float]] = field(default_factory=dict)
    """Fields of `Excitation` that differ from their defaults: duration_s, duty, hold_s, levels, …"""
    controller: Literal["pi", "rc"] = "pi"
    """What drives a closed loop, of the gains."""
    clean: bool = False
    """The plant alone: no noise, scatter, offset or digits."""
    sizes: Mapping[str, float] = field(default_factory=dict)
    """Disturbances that differ from their defaults, by the names of `Disturbance`."""
    seed: int = 0

    def __post_init__(self) -> None:
        if self.kind is not None and self.kind not in KINDS:
            raise UsageError(f"«kind» {self.kind}: is not one of {', '.join(KINDS)}")
        for what, names, kind in (("«sizes»", self.sizes, Disturbance), ("«shape»", self.shape, Excitation)):
            known = [each.name for each in fields(kind) if each.name != "kind"]
            for name in names:
                if name not in known:
                    raise UsageError(unknown(what, name, known))
        if self.shape and self.excitation is None:
            raise UsageError("«shape»: does nothing without «excitation»; leave it out")
        check_all(
            repeats=self.repeats, idle=self.idle_s, hold=self.hold_s, release=self.release_s, rate_hz=self.rate_hz,
            seed=self.seed,
            **{OPTION.get(name, name): value for name, value in self.sizes.items()},
        )  # fmt: skip
        for level in self.levels or ():
            check_all(levels=level)
        instead = {"«duty_file»": self.duty_file, "«plan»": self.plan, "«excitation»": self.excitation}
        said = [name for name, value in instead.items() if value is not None]
        if len(said) > 1:
            raise UsageError(f"{' and '.join(said[:2])} exclude each other; give one of them")
        if not said:
            return
        timing = (self.levels, self.idle_s, self.hold_s, self.release_s, self.repeats if self.plan else None)
        if any(value is not None for value in timing):
            raise UsageError(f"{said[0]}: says levels and times itself; leave out «levels», «idle», «hold», «release»")


def synthesize(
    options: SynthOptions = SynthOptions(),
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
    plant = REFERENCE[options.kind or "clutch"]() if fit is None else of_fit(fit, options.kind or fit.data.kind, named)
    disturbance = disturbance_of(options, plant)
    given = {each.name: getattr(options, each.name) for each in fields(Protocol)}
    said = {name: value for name, value in given.items() if value is not None}
    protocol = replace(PROTOCOLS[plant.kind], **{"levels": plant.levels, **said})
    if options.plan is not None:
        return synthesise_plan(plant, read_plan(options.plan), protocol.rate_hz, disturbance, options.seed)
    if options.duty_file is not None:
        changes, duration_s = read_input(options.duty_file, plant.kind, plant.input_unit)
        timing = replace(protocol, idle_s=0.0, hold_s=duration_s, release_s=0.0)
        return synthesise_input(plant, changes, timing, disturbance, options.seed)
    if options.excitation is not None:
        made = Excitation(options.excitation, **{"rate_hz": protocol.rate_hz, **options.shape})  # type: ignore[arg-type]
        return synthesise_excitation(
            plant, made, disturbance, options.seed, options.repeats or 1, controller_of(gains, options)
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
    return replace(base, **dict(options.sizes))
