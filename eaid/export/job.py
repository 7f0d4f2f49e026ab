"""One export, ready to be rendered: constants in the target's precision, heads, vectors."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from eaid.control.defaults import control_rate, input_limits
from eaid.control.gains import pi_gains, plant_of, rc_gains, refuse_other_units
from eaid.control.pi import PIGains
from eaid.control.rc import RCGains
from eaid.errors import UsageError, in_python
from eaid.export import reference
from eaid.export.constants import (
    Constants,
    Precision,
    Timing,
    decimal,
    harmless,
    inverse_constants,
    pi_constants,
    plant_constants,
    rate_constants,
    rc_constants,
    rounded,
)
from eaid.findings import Finding, say
from eaid.models.parameters import Nonlinear
from eaid.options import LAWS, ExportOptions
from eaid.replay.plant import plant_parameters, plant_terms
from eaid.results.codec import content_of, digest_of
from eaid.results.common import Input
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.version import __version__


@dataclass(frozen=True)
class Source:
    """Gains and plant in plain types, with their units and what is known of them."""

    rc: RCGains | None = None
    pi: PIGains | None = None
    plant: Nonlinear | None = None
    linear: tuple[float, float, float] | None = None  # a0, b0, c0 of the linear model
    limits: tuple[float, float] = (0.0, 100.0)
    units: tuple[str, str] = ("%", "N·m")
    rate_hz: float = 1000.0
    pwm_hz: float | None = None
    dead_time_s: float = 0.0
    origins: tuple[str, ...] = ()  # What the numbers came from, with a fingerprint each
    gains: Gains | None = None
    fit: Fit | None = None

    @property
    def laws(self) -> tuple[str, ...]:
        """The laws that can be exported."""
        plant = None if self.quick_falls else self.plant
        held = (("pi", self.pi), ("rc", self.rc), ("inverse", plant), ("plant", plant))
        return tuple(name for name, value in held if value is not None)

    @property
    def quick_falls(self) -> bool:
        """Whether falls between levels go as the release does, which no exported plant knows."""
        return self.plant is not None and self.plant.falls_as_release

    @property
    def top(self) -> float:
        """Largest torque of the rig, for test vectors."""
        if self.plant is not None:
            return plant_terms(plant_parameters(self.plant), self.plant.u_range[1])[2] or 1.0
        if self.linear is not None:
            a0, b0, c0 = self.linear
            return max((b0 * self.limits[1] + c0) / a0, 1e-3)
        return 1.0


def source_of(gains: Gains | None, fit: Fit | None) -> Source:
    """Both in plain types; UsageError where there is neither."""
    if gains is not None:
        source = _of_gains(gains)
    elif fit is not None:
        source = Source(limits=input_limits(fit), rate_hz=control_rate(fit), dead_time_s=fit.dead_time_s)
    else:
        raise UsageError("nothing to export: give gains, or a fit with a nonlinear model")
    if fit is None:
        return source
    refuse_other_units(fit, gains)
    origins = (*source.origins, f"fit: digest {digest_of(content_of(fit, 'fit'))}")
    return replace(
        source, plant=plant_of(fit), fit=fit, units=(fit.data.input_unit, fit.data.output_unit), origins=origins
    )


def _of_gains(gains: Gains) -> Source:
    timing = gains.margins.timing if gains.margins else None
    return Source(
        rc=rc_gains(gains), pi=pi_gains(gains), linear=(gains.model.a0, gains.model.b0, gains.model.c0),
        limits=gains.duty_limits_pct, units=(gains.input_unit, gains.output_unit),
        rate_hz=timing.rate_hz if timing else 1000.0, pwm_hz=timing.pwm_hz if timing else None,
        dead_time_s=timing.delay_samples / timing.rate_hz if timing else 0.0, gains=gains,
        origins=(f"gains: digest {digest_of(content_of(gains, 'gains'))}",),
    )  # fmt: skip


GO_ON, RESET, START = 0, 1, 2  # What comes before a row's step: nothing, a reset, a bumpless start
ROWS = 60  # Rows of the longest case


@dataclass(frozen=True)
class Vector:
    """One row; for the plant `reference` is the duty and `expected` the torque, for the rate `expected` is the rate."""

    law: str
    case: str
    before: int
    reference: Any
    rate: Any
    torque: Any
    duty: Any  # Where a bumpless start begins
    expected: Any
    status: int


# Law → init, reset, start, step
PLAYED: dict[str, tuple[Callable[..., Any], Callable[..., Any], Callable[..., Any], Callable[..., Any]]] = {
    "pi": (reference.integral_init, reference.integral_reset, reference.pi_start, reference.pi_step),
    "rc": (reference.integral_init, reference.integral_reset, reference.rc_start, reference.rc_step),
    "inverse": (reference.inverse_init, reference.inverse_reset, reference.inverse_start, reference.inverse_step),
}

Row = tuple[str, int, float, float, float, float]


def vectors(constants: Mapping[str, Constants], top: float, precision: Precision) -> list[Vector]:
    """All rows of all laws; `top` is the largest torque of the rig [output unit]."""
    cast: Callable[[float], Any] = np.float32 if precision == "single" else float
    made: list[Vector] = []
    for name in (name for name in constants if name in PLAYED):
        made += _controller(name, constants[name], cast, top)
    if "plant" in constants:
        made += _plant(constants["plant"], cast)
    if "rate" in constants:
        made += _rate(constants["rate"], cast, top)
    return made


def _controller(name: str, c: Any, cast: Callable[[float], Any], top: float) -> Iterator[Vector]:
    init, reset, start, step = PLAYED[name]
    state = init(c, c.dt)
    for case, before, *numbers in _rows(top, float(c.dt), float(c.duty_min), float(c.duty_max)):
        reference, rate, torque, duty = (cast(number) for number in numbers)
        if before == RESET:
            state = reset(state)
        elif before == START:
            state = start(c, state, reference, rate, torque, duty)
        state, given = step(c, state, reference, rate, torque)
        yield Vector(name, case, before, reference, rate, torque, duty, given, state.guard.status)


def _rows(top: float, dt: float, low: float, high: float) -> Iterator[Row]:
    torque = 0.0
    for k in range(ROWS):
        wanted = top * (0.1, 0.4, 0.2)[k * 3 // ROWS]
        yield "steps", RESET if k == 0 else GO_ON, wanted, 0.0, torque, 0.0
        torque += 0.05 * (wanted - torque)
    for k in range(ROWS):
        angles = [2 * math.pi * f * 8 * k * dt + 1.7 * i * i for i, f in enumerate((0.2, 0.5, 1.0, 2.0, 4.0))]
        wanted = top * (0.4 + 0.05 * sum(math.sin(a) for a in angles))
        slope = (
            top * 0.05 * sum(2 * math.pi * f * math.cos(a) for f, a in zip((0.2, 0.5, 1, 2, 4), angles, strict=True))
        )
        yield "multisine", RESET if k == 0 else GO_ON, wanted, slope, torque, 0.0
        torque += 0.2 * (wanted - torque)
    for k in range(ROWS // 2):
        wanted = top * (3.0 if k < ROWS // 4 else -1.0)
        yield "saturation", RESET if k == 0 else GO_ON, wanted, 0.0, torque, 0.0
        torque += 0.02 * (wanted - torque)
    bad = (math.nan, math.inf, -math.inf, 1e12)
    for k, (place, value) in enumerate((place, value) for place in range(3) for value in bad):
        row = [0.3 * top, 0.0, torque]
        row[place] = value
        yield "bad-input", RESET if k == 0 else GO_ON, row[0], row[1], row[2], 0.0
        yield "bad-input", GO_ON, 0.3 * top, 0.0, torque, 0.0
    for k in range(ROWS // 2):
        duty = low + (high - low) * (0.25 if k < ROWS // 4 else 0.7)
        yield "switch", START if k % (ROWS // 4) == 0 else GO_ON, 0.3 * top, 0.1 * top, 0.29 * top + 1e-3 * k, duty


def _plant(c: Any, cast: Callable[[float], Any]) -> Iterator[Vector]:
    state = reference.plant_init(c, c.dt)
    high = float(c.u_high)
    duties = [high * (0.0, 1.0, 0.3, 0.05, 0.0, 1.5, -0.2, 0.6)[k * 8 // (2 * ROWS)] for k in range(2 * ROWS)]
    duties += [math.nan, 0.5 * high, math.inf, 0.5 * high]
    nothing = cast(0.0)
    for k, number in enumerate(duties):
        duty = cast(number)
        state, torque = reference.plant_step(c, state, duty)
        case = "steps" if k < 2 * ROWS else "bad-input"
        yield Vector(
            "plant", case, RESET if k == 0 else GO_ON, duty, nothing, nothing, nothing, cast(torque), state.status
        )


def _rate(c: Any, cast: Callable[[float], Any], top: float) -> Iterator[Vector]:
    state = reference.rate_init()
    nothing = cast(0.0)
    for k in range(ROWS):
        number = math.nan if k == ROWS // 2 else top * (0.2 + 0.1 * math.sin(0.3 * k)) + (0.5 if k >= 45 else 0.0)
        state, rate = reference.rate_step(c, state, cast(number))
        before = RESET if k == 0 else GO_ON
        yield Vector("rate", "rate", before, cast(number), nothing, nothing, nothing, cast(rate), 0)


TITLES = {
    "pi": "PI of §V-B: u = K_P e + K_I ∫e",
    "rc": "Robust control, Eqs. (11)-(14)",
    "inverse": "Feedback linearisation with the nonlinear model, exact inverse of each sample",
    "plant": "The clutch: nonlinear model, Eqs. (4)-(7), for hardware in the loop",
}


@dataclass(frozen=True)
class Origin:
    """What made an export, for the heads of its files."""

    command: str = ""
    inputs: tuple[Input, ...] = ()


UNKNOWN = Origin()


@dataclass(frozen=True)
class Job:
    """What every target's templates draw on."""

    options: ExportOptions
    timing: Timing
    units: tuple[str, str]
    laws: tuple[str, ...]
    # Law, and `rate` where there is a controller → its constants of `eaid.export.reference`, rounded
    constants: Mapping[str, Constants]
    vectors: tuple[Vector, ...]
    head: tuple[str, ...]
    name: str  # The folder's name
    top: float  # Largest torque of the rig [output unit]


QUICK_FALLS = "the fit's falls between levels are as quick as its release, which an exported plant does not know"


def laws_of(source: Source, options: ExportOptions) -> tuple[str, ...]:
    """The laws to export, in one order; UsageError where one is asked for that the inputs do not hold."""
    wanted = options.law if options.law is not None else source.laws
    for law in wanted:
        if law not in source.laws and source.quick_falls:
            raise UsageError(f"«law» {law}: {QUICK_FALLS}; export the controllers alone, «law» pi,rc")
        if law not in source.laws:
            need = "gains.json of eaid tune-rc" if law in ("pi", "rc") else "fit.json with a nonlinear model, «fit»"
            raise UsageError(f"«law» {law} needs what was not given: {need}")
    if options.duty_on_fault and set(wanted) == {"plant"}:
        raise UsageError("«duty_on_fault»: is of a controller, and the plant alone is exported; leave it out")
    return tuple(law for law in LAWS if law in wanted)


def timing_of(source: Source, options: ExportOptions) -> Timing:
    """Sample time and what goes with it."""
    rate = options.rate_hz or float(f"{source.rate_hz:.9g}")  # of a log's stamps, which round
    return Timing(1.0 / rate, options.precision, options.duty_on_fault)


def constants_of(source: Source, laws: tuple[str, ...], timing: Timing) -> dict[str, Constants]:
    """Constants of each law, and of the rate's filter, in the target's precision; UsageError where one is too large."""
    made: dict[str, Constants] = {}
    if "pi" in laws and source.pi is not None:
        made["pi"] = pi_constants(source.pi, timing)
    if "rc" in laws and source.rc is not None:
        made["rc"] = rc_constants(source.rc, timing)
    if source.plant is not None:
        if "inverse" in laws:
            made["inverse"] = inverse_constants(source.plant, source.limits, timing)
        if "plant" in laws:
            made["plant"] = plant_constants(source.plant, timing)
    if set(laws) - {"plant"}:
        made["rate"] = rate_constants(timing)
    for law, constants in made.items():
        _refuse_what_is_too_large(law, constants, timing.precision)
    return {name: rounded(value, timing.precision) for name, value in made.items()}


MOST = {"double": 1e60, "single": 1e15}  # Largest constant: its square is a number still


def _refuse_what_is_too_large(law: str, constants: Any, precision: str) -> None:
    for name, value in constants._asdict().items():
        if hasattr(value, "_fields"):
            _refuse_what_is_too_large(law, value, precision)
        elif not all(abs(number) <= MOST[precision] for number in (value if isinstance(value, tuple) else (value,))):
            raise UsageError(
                f"{law}: {name} is {value:g}, which {precision} precision cannot hold safely; export others"
            )


def head_of(
    source: Source, laws: tuple[str, ...], timing: Timing, findings: tuple[Finding, ...], origin: Origin
) -> tuple[str, ...]:
    """What every file says of itself at its head."""
    origins = [f"{one.path}, sha256 {one.sha256}" for one in origin.inputs] or list(source.origins)
    lines = [
        f"{', '.join(laws)} for a rig, made by eaid {__version__}",
        "SPDX-License-Identifier: MIT",
        *(f"from {origin}" for origin in origins),
        *([f"by {origin.command}"] if origin.command else []),
        f"sample time {decimal(timing.dt_s)} s, {timing.precision} precision;"
        f" duty in {source.units[0]}, torque in {source.units[1]}",
        *(f"{one.severity}: {in_python(say(one))}" for one in findings),
    ]
    return tuple(harmless(line) for line in lines)
