"""The scenarios of the paper: a reference for each, and what is measured on it."""

import itertools
from collections.abc import Callable, Mapping

import msgspec

from eaid.arrays import Array
from eaid.control.defaults import Scales
from eaid.errors import UsageError
from eaid.models.parameters import Nonlinear
from eaid.options import Rig
from eaid.replay import metrics, references
from eaid.replay.controllers import Controller
from eaid.replay.loop import Trace, replay
from eaid.replay.plant import plant_parameters
from eaid.replay.references import Reference, Signal
from eaid.results.gain_checks import Tracking
from eaid.results.metrics import Metrics
from eaid.results.replay import Record, Role

SCENARIOS: dict[str, Callable[[float, float | None, float, float], Reference]] = {
    "steps": references.steps,
    "multisine": references.multisine,
    "sweep": references.sweep,
    "ramp": references.ramp,
}
"""Name → its reference at an interval and of a length [s], with factors on the paper's torque and frequencies."""


def reference_of(wanted: str | Signal, dt_s: float, scales: Scales, duration_s: float | None = None) -> Reference:
    """A scenario at the rig's own scale, or a signal of the user's own."""
    if not isinstance(wanted, str):
        return references.sampled(*wanted, dt_s)
    if wanted not in SCENARIOS:
        raise UsageError(f"no scenario {wanted!r}; there are {', '.join(SCENARIOS)}, and rehab to simulate")
    return SCENARIOS[wanted](dt_s, duration_s, scales.top, scales.pace)


def replayed(
    plant: Nonlinear, controller: Controller, reference: Reference, rig: Rig | None = None, seed: int = 0
) -> Tracking:
    """How well one controller tracks on one plant, over the samples that count."""
    trace = replay(plant_parameters(plant), controller, reference.torque_nm, rig or Rig(), reference.dt_s, seed)
    return trace.tracking(slice(reference.begin, None))


def measure(trace: Trace, reference: Reference) -> Metrics:
    """All metrics of a replay on its reference: tracking, then per step and per tone where there are any."""
    wanted, torque, dt_s = trace.reference_nm, trace.torque_nm, trace.dt_s
    steps = [
        metrics.step(torque[a:b], float(wanted[a - 1]), float(wanted[a]), dt_s)
        for a, b in itertools.pairwise([*reference.steps, len(torque)])
    ]
    tones = [
        metrics.tone(wanted[tone.begin : tone.end], torque[tone.begin : tone.end], tone.frequency_hz, dt_s)
        for tone in reference.tones
    ]
    return Metrics(
        **msgspec.structs.asdict(trace.tracking(slice(reference.begin, None))),
        counted_from_s=reference.counted_from_s,
        steps=tuple(steps),
        frequencies=tuple(tones),
    )


def record(
    trace: Trace, measured: Metrics, further: Mapping[str, Array] | None = None, role: Role = "controller"
) -> Record:
    """A replay as a group of replay.h5, with further columns of its length."""
    names = ("time_s", "reference_nm", "torque_nm", "duty_pct", "measured_nm", "applied_pct")
    columns = {name: column for name in names if (column := getattr(trace, name)) is not None}
    return Record({**columns, **(further or {})}, measured, role=role)
