"""The scenarios of the paper: a reference for each, and what is measured on it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import msgspec

from eaid.arrays import Array
from eaid.errors import UsageError
from eaid.replay import metrics, references
from eaid.replay.loop import Trace
from eaid.replay.references import Reference
from eaid.results.gain_checks import Tracking
from eaid.results.metrics import Metrics
from eaid.results.replay import Record


@dataclass(frozen=True)
class Scenario:
    """A row of the table: what is shown, and its reference."""

    shows: str
    make: Callable[[float, float | None, float, float], Reference]

    def reference(self, dt_s: float, duration_s: float | None = None, top: float = 1.0, pace: float = 1.0) -> Reference:
        """At an interval and of a length [s]; `top` is a factor on the paper's torque, `pace` on its frequencies."""
        return self.make(dt_s, duration_s, top, pace)


def _steps(dt_s: float, duration_s: float | None, top: float, pace: float) -> Reference:
    levels = references.STEP_LEVELS_NM
    hold_s = references.STEP_HOLD_S / pace if duration_s is None else duration_s / len(levels)
    return references.steps(dt_s, levels, hold_s, top)


def _sweep(dt_s: float, duration_s: float | None, top: float, pace: float) -> Reference:
    if duration_s is not None:
        raise UsageError("the sweep's length follows from its frequencies; leave «duration» out")
    return references.sweep(dt_s, top=top, pace=pace)


SCENARIOS: dict[str, Scenario] = {
    "steps": Scenario("0…4 N·m up and down (Fig. 11)", _steps),
    "multisine": Scenario("2 N·m and five sines of 0.2 N·m from 0.2 to 4 Hz (Fig. 12)", references.multisine),
    "sweep": Scenario("2 ± 1 N·m at 0.2…3 Hz, one frequency after another (Fig. 13)", _sweep),
    "ramp": Scenario("0 → 4 → 0 N·m at one slope", references.ramp),
}


def tracked(trace: Trace, reference: Reference) -> Tracking:
    """How well a replay tracks, from the reference's `counted_from_s` on."""
    part = slice(round(reference.counted_from_s / trace.dt_s), None)
    return metrics.tracking(
        trace.reference_nm[part], trace.torque_nm[part], trace.duty_pct[part], trace.dt_s, trace.limits_pct
    )


def measure(trace: Trace, reference: Reference) -> Metrics:
    """All metrics of a replay on its reference: tracking, then per step and per tone where there are any."""
    ends = [*reference.steps[1:], len(trace.torque_nm)]
    steps = [
        metrics.step(trace.torque_nm[a:b], float(trace.reference_nm[a - 1]), float(trace.reference_nm[a]), trace.dt_s)
        for a, b in zip(reference.steps, ends, strict=False)
    ]
    tones = [
        metrics.tone(
            trace.reference_nm[tone.begin : tone.end],
            trace.torque_nm[tone.begin : tone.end],
            tone.frequency_hz,
            trace.dt_s,
        )
        for tone in reference.tones
    ]
    return Metrics(
        **msgspec.structs.asdict(tracked(trace, reference)),
        counted_from_s=reference.counted_from_s,
        steps=tuple(steps),
        frequencies=tuple(tones),
    )


def record(trace: Trace, measured: Metrics, further: Mapping[str, Array] | None = None) -> Record:
    """A replay as a group of replay.h5, with further columns of its length."""
    columns = {
        "time_s": trace.time_s,
        "reference_nm": trace.reference_nm,
        "torque_nm": trace.torque_nm,
        "duty_pct": trace.duty_pct,
    }
    if trace.measured_nm is not None:
        columns["measured_nm"] = trace.measured_nm
    if trace.applied_pct is not None:
        columns["applied_pct"] = trace.applied_pct
    return Record({**columns, **(further or {})}, measured)
