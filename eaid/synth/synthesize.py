"""`synthesize`: logs of the reference plant, or of a fitted one, as if a rig had recorded them."""

from dataclasses import dataclass, fields, replace

from eaid.errors import UsageError
from eaid.logs.run import Run
from eaid.models.parameters import Nonlinear
from eaid.synth.disturbance import NONE, Disturbance
from eaid.synth.logs import PROTOCOLS, Protocol, synthesise
from eaid.synth.plants import REFERENCE, clutch


@dataclass(frozen=True)
class SynthOptions:
    """Which experiment is made, and how it is disturbed; None: as usual for its kind."""

    kind: str = "clutch"
    """clutch, friction-force or friction-speed."""
    levels: tuple[float, ...] | None = None
    repeats: int | None = None
    idle_s: float | None = None
    hold_s: float | None = None
    release_s: float | None = None
    rate_hz: float | None = None
    clean: bool = False
    """Without noise, ripple and scatter."""
    disturbance: Disturbance | None = None
    seed: int = 0


def synthesize(options: SynthOptions = SynthOptions(), plant: Nonlinear | None = None) -> list[Run]:
    """Synthetic logs.

    Parameters
    ----------
    options
        The experiment.
    plant
        A clutch in place of the reference plant.

    Raises
    ------
    UsageError
        A kind that there is none of.
    """
    if options.kind not in REFERENCE:
        raise UsageError(f"«kind» {options.kind}: must be one of {', '.join(REFERENCE)}")
    made = REFERENCE[options.kind]() if plant is None else clutch(plant, "a fitted plant")
    said = {name: getattr(options, name) for name in (field.name for field in fields(Protocol))}
    chosen = {name: value for name, value in said.items() if value is not None}
    protocol = replace(PROTOCOLS[made.kind], **{"levels": made.levels, **chosen})
    usual = NONE if options.clean else Disturbance()
    return synthesise(made, protocol, options.disturbance or usual, options.seed)
