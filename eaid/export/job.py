"""One export, ready to be rendered: constants in the target's precision, heads, vectors."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from eaid.errors import UsageError, in_python
from eaid.export.constants import (
    Constants,
    Timing,
    inverse_constants,
    pi_constants,
    plant_constants,
    rate_constants,
    rc_constants,
)
from eaid.export.made_from import Source
from eaid.export.numbers import decimal, harmless, rounded, unit_name
from eaid.export.vectors import Vector, vectors
from eaid.findings import Finding, say
from eaid.options import LAWS, ExportOptions
from eaid.results.common import Input
from eaid.version import __version__

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
    constants: Mapping[str, Constants]
    """Law, and `rate` where there is a controller → its constants of `eaid.export.reference`, rounded."""
    vectors: tuple[Vector, ...]
    head: tuple[str, ...]
    name: str
    """The folder's name."""
    top: float
    """Largest torque of the rig [output unit]."""


def laws_of(source: Source, options: ExportOptions) -> tuple[str, ...]:
    """The laws to export, in one order; UsageError where one is asked for that the inputs do not hold."""
    wanted = options.law if options.law is not None else source.laws
    for law in wanted:
        if law not in source.laws:
            need = "gains.json of eaid tune-rc" if law in ("pi", "rc") else "fit.json with a nonlinear model, «fit»"
            raise UsageError(f"«law» {law} needs what was not given: {need}")
    return tuple(law for law in LAWS if law in wanted)


def timing_of(source: Source, options: ExportOptions) -> Timing:
    """Sample time and what goes with it."""
    rate = options.rate_hz or source.rate_hz
    corner = options.rate_filter_hz or min(25.0, 0.1 * rate)
    if corner >= 0.5 * rate:
        raise UsageError(f"«rate_filter_hz» is {corner:g}; it must lie below half the control rate, {0.5 * rate:g} Hz")
    return Timing(1.0 / rate, options.precision, options.duty_on_fault, options.stuck_s, corner)


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


MOST = {"double": 1e60, "single": 1e15}
"""Largest constant: its square is a number still."""


def _refuse_what_is_too_large(law: str, constants: Any, precision: str) -> None:
    for name, value in constants._asdict().items():
        if hasattr(value, "_fields"):
            _refuse_what_is_too_large(law, value, precision)
        elif not all(abs(number) <= MOST[precision] for number in (value if isinstance(value, tuple) else (value,))):
            raise UsageError(
                f"{law}: {name} is {value:g}, which {precision} precision cannot hold safely; export others"
            )


def job_of(
    source: Source,
    constants: Mapping[str, Constants],
    timing: Timing,
    found: tuple[Finding, ...],
    options: ExportOptions,
    name: str,
    origin: Origin,
) -> Job:
    """Everything that the templates need."""
    laws = tuple(name for name in constants if name != "rate")
    return Job(
        options=options,
        timing=timing,
        units=(unit_name(source.units[0]), unit_name(source.units[1])),
        laws=laws,
        constants=constants,
        vectors=tuple(vectors(constants, source.top, timing.precision)),
        head=tuple(_head(source, laws, timing, found, origin)),
        name=name,
        top=source.top,
    )


def _head(
    source: Source, laws: tuple[str, ...], timing: Timing, found: tuple[Finding, ...], origin: Origin
) -> list[str]:
    origins = [f"{one.path}, sha256 {one.sha256}" for one in origin.inputs] or list(source.origins)
    lines = [
        f"{', '.join(laws)} for an electroadhesive clutch, made by eaid {__version__}",
        "SPDX-License-Identifier: MIT",
        *(f"from {origin}" for origin in origins),
        *([f"by {origin.command}"] if origin.command else []),
        f"sample time {decimal(timing.dt_s)} s, {timing.precision} precision;"
        f" duty in {source.units[0]}, torque in {source.units[1]}",
        *(f"{one.severity}: {in_python(say(one))}" for one in found),
    ]
    return [harmless(line) for line in lines]
