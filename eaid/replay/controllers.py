"""The controllers that a replay knows: what each needs from the user's files, and two laws.

Those of gains.json, with saturation and what it does to their integrals, stand in the table of `control/kinds.py`.

**Open loop.** The duty that the linear model holds the reference with.

**Inverse.** Feedback linearisation with the nonlinear model and its exact per-sample inverse, which the paper held too
costly. The torque after one sample of a held duty u, from the states x1, x2, is

    T⁺(u) = x1 + (1 − e^(−dt/τ1(u))) (C T_s(u) − x1) + x2 + (1 − e^(−dt/τ2(u))) ((1 − C) T_s(u) − x2) + d dt

and the controller plays the u with T⁺(u) = T_d(t_{k+1}), found between the duty limits by a secant kept inside a
bracket. Where no duty reaches it, it plays the limit on whose side the reference lies.

The states are not measured: an observer runs the model with the duty played, corrects both states with the innovation
e = T − x1 − x2, shared C to 1 − C, and learns what the model lacks as a rate of torque d [N·m/s]. Both its poles lie
at e^(−w dt): with the correction L1 = 1 − e^(−2 w dt) and the learning L2 = (1 − e^(−w dt))²/dt, the error of an
integrating plant has the characteristic polynomial (λ − e^(−w dt))². A noise of σ on the torque then moves the duty
about as much as a PD of that speed would, not as a deadbeat one; and a wrong plant leaves no steady error.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

from eaid.control.gains import law_of, physical
from eaid.control.kinds import ControllerStep, Law, row_of_gains
from eaid.errors import UsageError
from eaid.options import CONTROLLERS
from eaid.plant.dynamics import Plant, PlantNumbers, plant_numbers, plant_step
from eaid.plant.linear import LinearPlant
from eaid.results.gains import Gains


@dataclass(frozen=True)
class Controller:
    """A control law with its gains, ready to run; both are pure functions and tuples of floats."""

    name: str
    step: ControllerStep
    gains: Any
    start: Callable[[float], Any] = lambda _dt: 0  # Control interval [s] → the state before the first sample
    # The rate it is given leads to the next sample of the reference exactly (forward difference), else it is the
    # central one
    looks_ahead: bool = False

    @property
    def limits_pct(self) -> tuple[float, float]:
        """Duty limits that the law keeps [%]."""
        return self.gains.duty_min, self.gains.duty_max


class OpenLoopGains(NamedTuple):
    """The linear model, and the range of the actuator [%]."""

    a0: float
    b0: float
    c0: float
    duty_min: float = 0.0
    duty_max: float = 100.0


def open_loop_step(
    gains: OpenLoopGains, state: float, reference: float, _reference_rate: float, _torque: float, _dt: float
) -> tuple[float, float]:
    """u = (a0 T_d − c0)/b0, the duty of the linear model's steady torque; no state."""
    wanted = (gains.a0 * reference - gains.c0) / gains.b0
    return state, min(max(wanted, gains.duty_min), gains.duty_max)


OBSERVER_PER_S = 30.0  # Speed of the observer's two poles [1/s]
# Dead time of a plant, in parts of 1/that speed, up to which its inverse holds an output: three plants of other lags
# do at 0.6, and cycle at 0.9
LATEST_INVERSE = 0.65
DUTY_TOLERANCE_PCT = 1e-12  # The search ends when it moves the duty by no more than that
SEARCH_STEPS = 60  # Far more than the search takes (four to six)


class InverseGains(NamedTuple):
    """The model that is inverted, and the range of the actuator."""

    plant: PlantNumbers
    duty_min: float = 0.0  # [%]
    duty_max: float = 100.0  # [%]


class InverseState(NamedTuple):
    """The observer: where the model is, and what it lacks; at rest, nothing is learned."""

    x1: float = 0.0
    x2: float = 0.0
    lack: float = 0.0  # d [N·m/s]
    duty: float = 0.0  # Duty played last [%], where the next search begins


def duty_for(
    plant: PlantNumbers, x1: float, x2: float, wanted: float, dt: float, guess: float, low: float, high: float
) -> float:
    """Duty [%] in low…high after which x1 + x2 is `wanted` [N·m] when dt seconds have passed; the nearer limit where
    none is."""
    bottom, top = low, high
    duty = min(max(guess, low), high)
    before = miss_before = math.nan
    for _ in range(SEARCH_STEPS):
        y1, y2 = plant_step(plant, x1, x2, duty, dt)
        miss = y1 + y2 - wanted
        if miss == 0.0:
            return duty
        if miss < 0.0:
            if duty >= high:
                return high
            bottom = duty
        else:
            if duty <= low:
                return low
            top = duty
        rise = miss - miss_before
        if math.isnan(rise):  # the first: the next is 1 beside it
            better = min(max(duty + (1.0 if miss < 0.0 else -1.0), low), high)
        else:
            better = duty - miss * (duty - before) / rise if rise != 0.0 else 0.5 * (bottom + top)
        # A secant that leaves the bracket first tries the limit on that side, then halves.
        if better >= top:
            better = high if top >= high else 0.5 * (bottom + top)
        elif better <= bottom:
            better = low if bottom <= low else 0.5 * (bottom + top)
        if abs(better - duty) <= DUTY_TOLERANCE_PCT:
            return better
        before, miss_before, duty = duty, miss, better
    return duty


def inverse_step(
    gains: InverseGains, state: InverseState, reference: float, reference_rate: float, torque: float, dt: float
) -> tuple[InverseState, float]:
    """One sample: the next state, and the duty [%] after which the model's torque is the next sample of the reference,
    reference + rate·dt; the rate is the forward difference."""
    plant = gains.plant
    innovation = torque - state.x1 - state.x2
    kept = math.exp(-OBSERVER_PER_S * dt)
    correction = (1.0 - kept * kept) * innovation
    x1 = state.x1 + plant.C * correction
    x2 = state.x2 + (1.0 - plant.C) * correction
    lack = state.lack + (1.0 - kept) * (1.0 - kept) / dt * innovation
    wanted = reference + (reference_rate - lack) * dt
    duty = duty_for(plant, x1, x2, wanted, dt, state.duty, gains.duty_min, gains.duty_max)
    x1, x2 = plant_step(plant, x1, x2, duty, dt)
    return InverseState(x1 + lack * dt, x2, lack, duty), duty


OwnLaw = Callable[[float, float, float], float]
"""A user's controller in Python: time [s], reference and measured output → input."""


class OwnGains(NamedTuple):
    """A user's controller, and the range of the actuator [%]."""

    name: str
    law: OwnLaw
    duty_min: float
    duty_max: float


def own_step(
    gains: OwnGains, state: int, reference: float, _reference_rate: float, torque: float, dt: float
) -> tuple[int, float]:
    """The duty that a user's controller gives, kept within the range; the state counts samples."""
    given = gains.law(state * dt, reference, torque)
    try:
        duty = float(given)
    except (TypeError, ValueError):
        duty = math.nan
    if not math.isfinite(duty):
        when = f"{state * dt:g} s"
        raise UsageError(f"controller {gains.name}: gave {given!r:.40} at {when}, which is no input; give a number")
    return state + 1, min(max(duty, gains.duty_min), gains.duty_max)


def own_controllers(
    given: "str | OwnLaw | Sequence[str | OwnLaw] | None",
) -> "tuple[tuple[str, ...] | str | None, dict[str, OwnLaw]]":
    """Names of controllers, and a user's own by the names of their functions."""
    if given is None or isinstance(given, str):
        return given, {}
    each = [given] if callable(given) else list(given)
    names, own = tuple(one for one in each if isinstance(one, str)), dict[str, OwnLaw]()
    for one in (one for one in each if not isinstance(one, str)):
        if not callable(one):
            raise UsageError(f"«controller» {one!r:.40}: give names, or functions of time, reference and output")
        name = getattr(one, "__name__", type(one).__name__).strip("<>")
        own[f"{name}-{len(own) + 1}" if name in own or name in CONTROLLERS else name] = one
    return names or None, own


def feedback(gains: Law) -> Controller:
    """A controller of the table, whose gains they are, ready to replay."""
    kind = row_of_gains(gains)
    return Controller(kind.name, kind.step, gains, partial(kind.start, gains))


def why_no_inverse(plant: Plant) -> str:
    """What a plant has that its inverse does not know; empty: nothing."""
    if plant.zeta is not None:
        return f"two states, {plant.kind}"
    if plant.signed:
        return "an input of both signs"
    late = plant.dead_time_s * OBSERVER_PER_S > LATEST_INVERSE
    return f"a dead time of {plant.dead_time_s:.3g} s, behind which its loop cycles" if late else ""


def controller_of(
    name: str, plant: Plant, linear: LinearPlant | None, gains: Gains | None, limits_pct: tuple[float, float]
) -> Controller:
    """A controller by its name, from the fitted models, gains, and the range of the actuator [%] for those that have no
    gains of their own; `UsageError` where what it needs is missing."""
    if name == "inverse":
        if why := why_no_inverse(plant):
            raise UsageError(
                f"controller inverse: knows one lag and two in parallel, and the fit's plant has {why}; take rc or pi"
            )
        inverse = InverseGains(plant_numbers(plant), *limits_pct)
        return Controller("inverse", inverse_step, inverse, lambda _dt: InverseState(), looks_ahead=True)
    if name == "open-loop":
        if linear is None:
            raise UsageError("controller open-loop needs a linear model: fit it too, or give «gains», which hold one")
        linear = physical(linear)
        law = OpenLoopGains(linear.a0, linear.b0, linear.c0, *limits_pct)
        return Controller("open-loop", open_loop_step, law)
    held = law_of(gains, name)
    if held is None and gains is not None and name in gains.refused:
        raise UsageError(f"controller {name}: {gains.refused[name]}")
    if held is None and gains is not None:
        raise UsageError(f"controller {name}: the gains hold only {', '.join(gains.controllers_by_name)}")
    if held is None:
        raise UsageError(f"controller {name} needs gains: give «gains», which eaid tune-rc writes")
    return feedback(held)
