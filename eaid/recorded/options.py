"""The choices of a fit of recorded logs."""

from dataclasses import dataclass

from eaid.errors import UsageError
from eaid.fitting.choices import MODELS
from eaid.models.parameters import SHARE

CI = ("robust", "none")
FALLS = ("auto", "as-rises")


@dataclass(frozen=True)
class RecordedOptions:
    """How recorded logs are fitted."""

    models: tuple[str, ...] | None = None
    """Models to fit: nonlinear, linear, friction; None: all that the logs allow."""
    share: float | None = SHARE
    """C, held; None: free."""
    u_range: tuple[float, float] | None = None
    """Lowest and highest identified input; None: those that the logs hold, of moving inputs the middle 98 % of time."""
    rest: float = 0.0
    """Input at rest, from which levels are counted."""
    falls: str = "auto"
    """auto: falls get unknowns of their own where the data show that they differ; as-rises: never."""
    instrument: bool = False
    """Closed loops: the simulated noise-free duty is taken as an instrument."""
    loop_refits: int = 12
    """Simulated loops whose refits show the bias of a direct fit; 0: none."""
    ci: str = "robust"
    """robust, or none."""
    seed: int = 0


def check(options: RecordedOptions) -> None:
    """Refuse choices that are not in their tables."""
    for name in options.models or ():
        if name not in MODELS:
            raise UsageError(f"«model» {name}: recorded logs can be fitted with {', '.join(MODELS)}")
    for name, value, table in (("ci", options.ci, CI), ("falls", options.falls, FALLS)):
        if value not in table:
            raise UsageError(f"«{name}» {value}: must be one of {', '.join(table)}")
    if options.share is not None and not 0 < options.share < 1:
        raise UsageError(f"«share» {options.share:g}: the share of the fast part lies between 0 and 1; or say free")
    if options.u_range is not None and not 0 <= options.u_range[0] < options.u_range[1]:
        raise UsageError(f"«duty» {options.u_range[0]:g}:{options.u_range[1]:g}: give two inputs that rise from 0")
