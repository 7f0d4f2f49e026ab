"""The scenarios of the paper: a reference for each, and what is measured on it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from eaid.arrays import Array
from eaid.errors import UsageError
from eaid.replay import metrics, references
from eaid.replay.files import Record
from eaid.replay.loop import Replay
from eaid.replay.references import Reference

NOTHING: Mapping[str, Array] = MappingProxyType({})


@dataclass(frozen=True)
class Scenario:
    """A row of the table: what is shown, and the reference at an interval [s] and a length [s], None for the
    scenario's own."""

    shows: str
    reference: Callable[[float, float | None], Reference]


def _steps(dt_s: float, duration_s: float | None) -> Reference:
    if duration_s is None:
        return references.steps(dt_s)
    return references.steps(dt_s, hold_s=duration_s / len(references.STEP_LEVELS_NM))


def _multisine(dt_s: float, duration_s: float | None) -> Reference:
    return references.multisine(dt_s, references.MULTISINE_S if duration_s is None else duration_s)


def _sweep(dt_s: float, duration_s: float | None) -> Reference:
    if duration_s is not None:
        raise UsageError("the sweep's length follows from its frequencies; leave --duration out")
    return references.sweep(dt_s)


SCENARIOS: dict[str, Scenario] = {
    "steps": Scenario("0…4 N·m up and down (Fig. 11)", _steps),
    "multisine": Scenario("2 N·m and five sines of 0.2 N·m from 0.2 to 4 Hz (Fig. 12)", _multisine),
    "sweep": Scenario("2 ± 1 N·m at 0.2…3 Hz, one frequency after another (Fig. 13)", _sweep),
}


def measure(replay: Replay, reference: Reference) -> dict[str, Any]:
    """All metrics of a replay on its reference: tracking from `counted_from_s` on, then per step and per tone where
    there are any."""
    begin = round(reference.counted_from_s / replay.dt_s)
    result: dict[str, Any] = dict(
        metrics.tracking(
            replay.reference_nm[begin:],
            replay.torque_nm[begin:],
            replay.duty_pct[begin:],
            replay.dt_s,
            replay.limits_pct,
        )
    )
    result["counted_from_s"] = reference.counted_from_s
    if reference.steps:
        ends = [*reference.steps[1:], len(replay.torque_nm)]
        result["steps"] = [
            metrics.step(
                replay.torque_nm[a:b], float(replay.reference_nm[a - 1]), float(replay.reference_nm[a]), replay.dt_s
            )
            for a, b in zip(reference.steps, ends, strict=True)
        ]
    if reference.tones:
        result["frequencies"] = [
            metrics.tone(
                replay.reference_nm[tone.begin : tone.end],
                replay.torque_nm[tone.begin : tone.end],
                tone.frequency_hz,
                replay.dt_s,
            )
            for tone in reference.tones
        ]
    return result


def record(replay: Replay, measured: dict[str, Any], further: Mapping[str, Array] = NOTHING) -> Record:
    """A replay as a group of replay.h5, with further columns of its length."""
    columns = {
        "time_s": replay.time_s,
        "reference_nm": replay.reference_nm,
        "torque_nm": replay.torque_nm,
        "duty_pct": replay.duty_pct,
    }
    if replay.measured_nm is not None:
        columns["measured_nm"] = replay.measured_nm
    if replay.applied_pct is not None:
        columns["applied_pct"] = replay.applied_pct
    return Record({**columns, **further}, measured)
