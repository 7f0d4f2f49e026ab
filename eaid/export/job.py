"""One export, ready to be rendered: constants in the target's precision, heads, vectors."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from eaid.control.defaults import control_rate, input_limits
from eaid.control.gains import law_of, plant_of, refuse_other_units
from eaid.control.kinds import Law
from eaid.errors import UsageError, in_python
from eaid.export import reference
from eaid.export.constants import (
    CONSTANTS,
    SERIES,
    Entries,
    RigInfo,
    decimal,
    in_comment,
    namespace,
    rounded,
    unit_name,
)
from eaid.findings import Finding, finding, say
from eaid.options import LAWS, ExportOptions
from eaid.plant.dynamics import Plant, plant_numbers, plant_terms
from eaid.replay.controllers import why_no_inverse
from eaid.results.codec import content_of, digest_of
from eaid.results.common import Input
from eaid.results.fit import Fit
from eaid.results.gains import Gains, Timing
from eaid.shown import input_word, output_word
from eaid.version import __version__

GO_ON, RESET, BUMPLESS = 0, 1, 2  # What comes before a row's step: nothing, a reset, a bumpless start
CASE_ROWS = 60  # Rows of the longest case
TONES_HZ = (0.2, 0.5, 1.0, 2.0, 4.0)  # Of the multisine
REFERENCES: dict[str, Any] = {
    "pi": reference.PI, "rc": reference.RC, "pi_feedforward": reference.PIFeedforward,
    "inverse": reference.Inverse, "plant": reference.Plant, "rate": reference.Rate,
}  # fmt: skip
OF_ONE = ("plant", "rate")  # Whose step takes one number
Check = tuple[str, int, float, float, float, float]  # Case, what comes before, and the numbers of a `Vector`


@dataclass(frozen=True)
class Origin:
    """Gains and plant in plain types, with their units and what is known of them."""

    gains: Gains | None
    fit: Fit | None
    loops: Mapping[str, Law]
    plant: Plant | None
    limits: tuple[float, float]
    units: tuple[str, str]
    made_for: Timing

    @property
    def laws(self) -> tuple[str, ...]:
        """The laws that can be exported."""
        held = {**self.loops, "inverse": self.plant, "plant": self.plant}
        return tuple(name for name in LAWS if held.get(name) is not None and not self.left_out(name))

    def left_out(self, law: str) -> str:
        """What the plant has that an exported plant, or its inverse, does not know; empty: nothing."""
        p = self.plant
        if p is None or law not in ("inverse", "plant"):
            return ""
        if p.zeta is not None and any(p.tau1[1:]):
            return f"a {p.kind} whose time changes with the input"
        return why_no_inverse(p) if law == "inverse" else ""

    @property
    def top(self) -> float:
        """Largest torque of the rig, for test vectors."""
        if self.plant is not None:
            return plant_terms(plant_numbers(self.plant), self.plant.u_range[1])[2] or 1.0
        assert self.gains is not None
        model = self.gains.model
        return max((model.b0 * self.limits[1] + model.c0) / model.a0, 1e-3)


def source_of(gains: Gains | None, fit: Fit | None) -> Origin:
    """Both in plain types; UsageError where there is neither."""
    if fit is not None:
        refuse_other_units(fit, gains)
    plant = None if fit is None else plant_of(fit)
    if gains is not None:
        timing = gains.margins.timing if gains.margins else Timing()
        units = gains.input_unit, gains.output_unit
        loops = {name: law for name in CONSTANTS if (law := law_of(gains, name)) is not None}
        return Origin(gains, fit, loops, plant, gains.duty_limits_pct, units, timing)
    if fit is None:
        raise UsageError("nothing to export: give gains, or a fit with a nonlinear model")
    units = fit.data.input_unit, fit.data.output_unit
    return Origin(None, fit, {}, plant, input_limits(fit), units, Timing(control_rate(fit)))


class Vector(NamedTuple):
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


def vectors(constants: Mapping[str, Entries], top: float, rig: RigInfo) -> Iterator[Vector]:
    """All rows of all laws; `top` is the largest torque of the rig [output unit]."""
    series = rounded(SERIES[rig.precision], rig.precision)
    for law, entries in constants.items():
        c = namespace(entries, series)
        acting = REFERENCES[law](c)
        if law == "plant":
            rows = _duties(float(c.u_high), len(acting.held))
        elif law == "rate":
            rows = _wanted(top)
        else:
            rows = _checks(top, float(c.dt), float(c.duty_min), float(c.duty_max))
        for case, before, *numbers in rows:
            wanted, slope, torque, duty = (rounded(number, rig.precision) for number in numbers)
            if before == RESET:
                acting.reset()
            elif before == BUMPLESS:
                acting.start(wanted, slope, torque, duty)
            given = acting.step(wanted) if law in OF_ONE else acting.step(wanted, slope, torque)
            yield Vector(law, case, before, wanted, slope, torque, duty, rounded(given, rig.precision), acting.status)


def _checks(top: float, dt: float, low: float, high: float) -> Iterator[Check]:
    torque = 0.0
    for k in range(CASE_ROWS):
        wanted = top * (0.1, 0.4, 0.2)[k * 3 // CASE_ROWS]
        yield "steps", RESET if k == 0 else GO_ON, wanted, 0.0, torque, 0.0
        torque += 0.05 * (wanted - torque)
    for k in range(CASE_ROWS):
        angles = [2 * math.pi * f * 8 * k * dt + 1.7 * i * i for i, f in enumerate(TONES_HZ)]
        wanted = top * (0.4 + 0.05 * sum(math.sin(a) for a in angles))
        slopes = (2 * math.pi * f * math.cos(a) for f, a in zip(TONES_HZ, angles, strict=True))
        yield "multisine", RESET if k == 0 else GO_ON, wanted, top * 0.05 * sum(slopes), torque, 0.0
        torque += 0.2 * (wanted - torque)
    for k in range(CASE_ROWS // 2):
        wanted = top * (3.0 if k < CASE_ROWS // 4 else -1.0)
        yield "saturation", RESET if k == 0 else GO_ON, wanted, 0.0, torque, 0.0
        torque += 0.02 * (wanted - torque)
    bad = (math.nan, math.inf, -math.inf, 1e12)
    for k, (place, value) in enumerate((place, value) for place in range(3) for value in bad):
        row = [0.3 * top, 0.0, torque]
        row[place] = value
        yield "bad-input", RESET if k == 0 else GO_ON, row[0], row[1], row[2], 0.0
        yield "bad-input", GO_ON, 0.3 * top, 0.0, torque, 0.0
    for k in range(CASE_ROWS // 2):
        duty = low + (high - low) * (0.25 if k < CASE_ROWS // 4 else 0.7)
        before = BUMPLESS if k % (CASE_ROWS // 4) == 0 else GO_ON
        yield "switch", before, 0.3 * top, 0.1 * top, 0.29 * top + 1e-3 * k, duty


def _duties(high: float, held: int) -> Iterator[Check]:
    for k in range(2 * CASE_ROWS):
        duty = high * (0.0, 1.0, 0.3, 0.05, 0.0, 1.5, -0.2, 0.6)[k * 4 // CASE_ROWS]
        yield "steps", RESET if k == 0 else GO_ON, duty, 0.0, 0.0, 0.0
    for duty in (math.nan, 0.5 * high, math.inf, *[0.5 * high] * held):
        yield "bad-input", GO_ON, duty, 0.0, 0.0, 0.0


def _wanted(top: float) -> Iterator[Check]:
    for k in range(CASE_ROWS):
        wanted = top * (0.2 + 0.1 * math.sin(0.3 * k)) + (0.5 if k >= 45 else 0.0)
        yield "rate", RESET if k == 0 else GO_ON, math.nan if k == CASE_ROWS // 2 else wanted, 0.0, 0.0, 0.0


@dataclass(frozen=True)
class Job:
    """What every target's templates draw on."""

    rig: RigInfo
    laws: tuple[str, ...]
    # Law, and `rate` where there is a controller → its constants, rounded
    constants: Mapping[str, Entries]
    vectors: tuple[Vector, ...]
    head: tuple[str, ...]
    target: str
    name: str  # The folder's name
    top: float  # Largest torque of the rig [output unit]
    limits: tuple[float, float]  # Of the duty
    log_s: tuple[float, float, float]  # Rest and hold of a step that the check program logs, and a piece of its loops


PAPERS_LOG_S = (2.0, 15.0, 2.0)  # `Job.log_s` of the paper's rig, and of those whose slowest lag lies between …
PAPERS_LAG_S = (2.0, 60.0)  # … these


def log_seconds(plant: Plant | None) -> tuple[float, float, float]:
    """How long the check program logs a plant: the paper's times, of far slower or quicker ones by their lags."""
    if plant is None:
        return PAPERS_LOG_S
    slow, late = plant.slowest_s(np.array(plant.u_range)), plant.dead_time_s
    if PAPERS_LAG_S[0] <= slow <= PAPERS_LAG_S[1]:
        return PAPERS_LOG_S
    rest, hold, piece = (float(f"{one:.2g}") for one in (slow, 5 * slow + late, 2 * slow + late))
    return rest, hold, piece


def laws_of(source: Origin, options: ExportOptions) -> tuple[str, ...]:
    """The laws to export, in one order; UsageError where one is asked for that the inputs do not hold."""
    wanted = options.law if options.law is not None else source.laws
    for law in wanted:
        if law not in source.laws and (what := source.left_out(law)):
            raise UsageError(f"«law» {law}: {say(finding('export-left-out', law, what=what))}")
        if source.gains is not None and law in source.gains.refused:
            raise UsageError(f"«law» {law}: {source.gains.refused[law]}")
        if law not in source.laws:
            if law in CONSTANTS and source.gains is not None:
                held = ", ".join(source.laws) or "none"
                raise UsageError(f"«law» {law}: these gains hold no {law}; take one of {held}, or run tune-rc again")
            need = "gains.json of eaid tune-rc" if law in CONSTANTS else "fit.json with a nonlinear model, «fit»"
            raise UsageError(f"«law» {law} needs what was not given: {need}")
    if options.duty_on_fault and set(wanted) == {"plant"}:
        raise UsageError("«duty_on_fault»: is of a controller, and the plant alone is exported; leave it out")
    (low, high), given = source.limits, options.duty_on_fault
    if given and not low <= given <= high:
        raise UsageError(
            f"«duty_on_fault» {given:g}: every fault would give it, and the actuator has {low:g} to {high:g} "
            f"{source.units[0]}; give one of these"
        )
    return tuple(law for law in LAWS if law in wanted)


def rig_for(source: Origin, options: ExportOptions) -> RigInfo:
    """Sample time, precision and units."""
    rate = options.rate_hz or float(f"{source.made_for.rate_hz:.9g}")  # of a log's stamps, which round
    return RigInfo(1.0 / rate, options.precision, float(options.duty_on_fault), *map(unit_name, source.units))


def head_of(
    source: Origin,
    laws: tuple[str, ...],
    rig: RigInfo,
    findings: Sequence[Finding],
    command: str,
    inputs: Sequence[Input],
) -> tuple[str, ...]:
    """What every file says of itself at its head."""
    origins = [f"{one.path}, sha256 {one.sha256}" for one in inputs] or [
        f"{kind}: digest {digest_of(content_of(one, kind))}"
        for kind, one in (("gains", source.gains), ("fit", source.fit))
        if one is not None
    ]
    lines = [
        f"{', '.join(laws)} for a rig, made by eaid {__version__}",
        "SPDX-License-Identifier: MIT",
        *(f"from {origin}" for origin in origins),
        *([f"by {command}"] if command else []),
        f"sample time {decimal(rig.dt_s)} s, {rig.precision} precision;"
        f" duty: the {input_word(source.units[0])} in {source.units[0]}, torque: the {output_word(source.units[1])} in "
        f"{source.units[1]}",
        *(f"{one.severity}: {in_python(say(one))}" for one in findings),
    ]
    return tuple(in_comment(line) for line in lines)
