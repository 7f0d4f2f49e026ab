"""The table of the controllers that a file of gains holds: one row each, with all that the rooms need to know of it.

A new one is a module with its gains as a tuple of floats that ends with the limits of the duty, its `…_step`, `law` and
`design`, a row here, and its name among the words that commands take (`options.CONTROLLERS`): replays, Monte-Carlo,
margins, tables and gains.json (its `controllers`) have it then.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from eaid.control import pi_feedforward, smith
from eaid.control.pi import PIGains, Wanted, pi_step
from eaid.control.pi_feedforward import PIFeedforwardGains, pi_feedforward_step
from eaid.control.rc import RCGains, rc_step
from eaid.control.smith import SmithGains, smith_step
from eaid.errors import GainsError
from eaid.plant.linear import LinearPlant
from eaid.results.gains import PI, Robust

Law = RCGains | PIGains | PIFeedforwardGains | SmithGains
# step(gains, state, reference, reference_rate, torque, dt) → (next state, duty)
ControllerStep = Callable[[Any, Any, float, float, float, float], tuple[Any, float]]


def rc_law(model: LinearPlant, rc: Robust, limits_pct: tuple[float, float]) -> RCGains:
    """The robust controller on a model as its step takes it."""
    Q12, Q22 = rc.Q[1]
    return RCGains(
        rc.K_P, rc.K_D, rc.B_hat, model.a0, model.b0, model.c0, rc.rho.constant, rc.rho.slope, rc.epsilon, rc.gamma,
        Q12, Q22, *limits_pct,
    )  # fmt: skip


@dataclass(frozen=True)
class LawKind:
    """One controller."""

    name: str  # As commands and files have it
    title: str  # As readers have it
    gains: type  # What its step takes, floats only, the limits of the duty last
    step: ControllerStep
    # Model, what a file holds of it, limits → what its step takes
    law: Callable[[LinearPlant, Any, tuple[float, float]], Law]
    shown: Mapping[str, str] = field(default_factory=dict)  # Its numbers in a table, and how they are written
    positive: tuple[str, ...] = ()  # Those that no loop runs without
    # Its gains once the robust controller has its own; GainsError: why it has none, None: it is of no use. Without a
    # design, `tune` makes it, and it has a key of its own
    design: Callable[[Wanted], dict[str, float] | None] | None = None
    start: Callable[[Any, float], Any] = lambda _gains, _dt: 0.0  # Gains, control interval [s] → the state at rest
    around: Callable[[Any], Any] | None = None  # Its linear part where its state is more than an integral


CONTROLLER_ROWS = (
    LawKind("rc", "RC", RCGains, rc_step, rc_law, Robust.SHOWN,
            ("K_P", "K_D", "B_hat", "b0", "epsilon", "gamma", "Q22")),
    LawKind("pi", "PI", PIGains, pi_step, lambda _model, pi, limits: PIGains(pi.K_P, pi.K_I, *limits), PI.SHOWN),
    LawKind("pi-feedforward", "PI with RC's feedforward", PIFeedforwardGains, pi_feedforward_step, pi_feedforward.law,
         {"K_P": "K_P", "K_I": "K_I", "B_hat": "B̂"}, ("B_hat", "b0"), pi_feedforward.design),
    LawKind("smith", "PI with Smith predictor", SmithGains, smith_step, smith.law,
         {"K_P": "K_P", "K_I": "K_I", "dead_time_s": "dead time"}, ("dead_time_s", "a0", "b0"), smith.design,
         smith.start, smith.Around),
)  # fmt: skip
LAW_KINDS: dict[str, LawKind] = {row.name: row for row in CONTROLLER_ROWS}


def row_of_gains(gains: Law) -> LawKind:
    """The row of what a step takes."""
    return next(row for row in CONTROLLER_ROWS if isinstance(gains, row.gains))


def designs(wanted: Wanted) -> tuple[dict[str, dict[str, float]], dict[str, str]]:
    """Gains of the controllers that follow from the robust one, by name, and why others have none."""
    made, refused = {}, {}
    for row in CONTROLLER_ROWS:
        try:
            held = None if row.design is None else row.design(wanted)
        except GainsError as error:
            refused[row.name] = str(error)
            continue
        if held is not None:
            made[row.name] = held
    return made, refused
