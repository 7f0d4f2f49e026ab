"""Logs of a plant, as a rig would have recorded them.

A run idles, holds its level, and is released; its torque is that of the replay's plant (`eaid.plant.respond.driven`).
"""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields, replace
from math import exp

import numpy as np

from eaid.arrays import Array, read_only
from eaid.errors import UsageError
from eaid.logs.run import Run
from eaid.options import EXPERIMENTS
from eaid.plant.respond import driven
from eaid.replay.loop import coloured
from eaid.replay.references import MOST_SAMPLES
from eaid.synth.plants import Scatter, Specimen


@dataclass(frozen=True)
class Disturbance:
    """Sizes of everything that is not the plant, as the options of `SynthOptions` of the same names; all 0: the plant
    alone. Ripple and coloured noise are shares of the torque [1], the ripple's phase differs from run to run."""

    white_nm: float = 0.01
    coloured: float = 0.01
    coloured_s: float = 0.05
    ripple: float = 0.01
    gain_scatter: float = 0.03
    tau1_scatter: float = 0.05
    tau2_scatter: float = 0.0
    offset_nm: float = 0.02
    resolution_nm: float = 1 / 1024


# The plant alone
NONE = Disturbance(**{field.name: 0.0 for field in fields(Disturbance) if field.name != "coloured_s"})


def scatter(d: Disturbance, draw: np.random.Generator) -> Scatter:
    """The factors of one run."""
    gain, tau1, tau2 = draw.standard_normal(3).tolist()
    return Scatter(1 + d.gain_scatter * gain, exp(d.tau1_scatter * tau1), exp(d.tau2_scatter * tau2))


def measured(torque_nm: Array, time_s: Array, rotor_hz: Array, d: Disturbance, draw: np.random.Generator) -> Array:
    """What the sensor says [N·m] of a torque [N·m] while the rotor turns at `rotor_hz` [Hz]; all of shape (n,)."""
    share, white = noise(time_s, rotor_hz, d, draw)
    return digits(torque_nm * (1 + share) + d.offset_nm + white, d)


def noise(time_s: Array, rotor_hz: Array, d: Disturbance, draw: np.random.Generator) -> tuple[Array, Array]:
    """Noise and ripple as a share of the torque [1], and the noise that is added to it [N·m], shapes (n,)."""
    n = time_s.size
    phase = draw.uniform(0, 2 * np.pi)
    white = draw.standard_normal(n)
    share: Array = np.zeros(n)
    if d.ripple > 0:
        share += d.ripple * np.sin(2 * np.pi * rotor_hz * time_s + phase)
    if d.coloured > 0:
        share += d.coloured * coloured(n, (time_s[-1] - time_s[0]) / max(n - 1, 1), d.coloured_s, draw)
    return share, d.white_nm * white


def digits(torque_nm: Array, d: Disturbance) -> Array:
    """A reading in whole steps of the sensor's digits [N·m]."""
    return np.round(torque_nm / d.resolution_nm) * d.resolution_nm if d.resolution_nm > 0 else torque_nm


def mark(plant: Specimen, disturbance: Disturbance, seed: int) -> str:
    """What every synthetic log says of itself: of what, disturbed how, with which seed."""
    sizes = asdict(disturbance if disturbance.coloured > 0 else replace(disturbance, coloured_s=0.0))
    disturbances = ", ".join(f"{name} {value:g}" for name, value in sizes.items() if value)
    return f"eaid synth of {plant.made_of}; {disturbances or 'undisturbed'}; seed {seed}; recorded on no rig"


@dataclass(frozen=True)
class Protocol:
    """How an experiment is recorded, as the options of the same names; each level [%, N or RPM] is a run of its own,
    and without a release the log ends with the input held."""

    levels: tuple[float, ...]
    repeats: int = 3
    idle_s: float = 10.0
    hold_s: float = 20.0
    release_s: float = 10.0
    rate_hz: float = 1000.0


# Defaults of each kind; the levels are the plant's
PROTOCOLS: dict[str, Protocol] = {
    "clutch": Protocol(levels=()),
    "friction-force": Protocol(levels=(), repeats=2, idle_s=2.0, hold_s=60.0, release_s=0.0),
    "friction-speed": Protocol(levels=(), repeats=2, idle_s=2.0, hold_s=60.0, release_s=0.0),
}

Input = Sequence[tuple[float, float]]  # A piecewise constant input: (from when [s], value), the first at 0
Columns = tuple[Array, Array, Array]  # Time [s], input and output of a log, shapes (n,)


def synthesise(plant: Specimen, protocol: Protocol, disturbance: Disturbance, seed: int) -> list[Run]:
    """Runs of idle, step, hold and release; the seed, the place of a level and the repeat make a run."""
    check_protocol(plant, protocol)
    p, end_s, runs = protocol, protocol.idle_s + protocol.hold_s, []
    for place, level in enumerate(map(float, p.levels)):
        changes = [(0.0, 0.0)] * (p.idle_s > 0) + [(p.idle_s, level), (end_s, 0.0)]
        wide = f"{level:05.1f}"  # so that names sort, where a tenth tells the level exactly
        name = wide if float(wide) == level else f"{level:.9g}"
        key = seed, EXPERIMENTS.index(plant.kind), place
        made = repeats(plant, name, changes, end_s + p.release_s, p, disturbance, key)
        runs += [replace(run, level=level, step_s=p.idle_s) for run in made]
    return runs


def repeats(
    plant: Specimen, what: str, changes: Input, duration_s: float, protocol: Protocol, disturbance: Disturbance,
    key: tuple[int, ...],
) -> Iterator[Run]:  # fmt: skip
    """The runs of one input, each of a rig that was at rest before; key, the seed first, and repeat make its noise."""
    starts, levels = np.array(changes).T
    time_s = np.arange(round(duration_s * protocol.rate_hz)) / protocol.rate_hz
    for repeat in range(1, protocol.repeats + 1):
        draw = np.random.default_rng([*key, repeat])
        columns = played(plant, scatter(disturbance, draw), (starts, levels), time_s, disturbance, draw)
        yield run_of(plant, columns, what, repeat, mark(plant, disturbance, key[0]))


def played(
    plant: Specimen, factors: Scatter, steps: tuple[Array, Array], time_s: Array, disturbance: Disturbance,
    draw: np.random.Generator,
) -> Columns:  # fmt: skip
    """What one run of the rig gives where the input takes some values, each from an instant on: (instants, values)."""
    starts, levels = steps
    value = levels[np.searchsorted(starts, time_s, side="right") - 1]
    torque = driven(plant.acting(factors), starts, levels, time_s)
    return time_s, value, measured(torque, time_s, plant.rotor_hz(value), disturbance, draw)


def run_of(
    plant: Specimen, columns: Columns, what: str, repeat: int, synthetic: str, reference: Array | None = None
) -> Run:
    """Columns as a run that says what it is of and what made it; its fingerprint is theirs."""
    time_s, value, output = map(read_only, columns)
    return Run(
        f"synthetic-{plant.kind}-{what}-r{repeat}", time_s, value, output, plant.input_unit, plant.output_unit,
        source="eaid synth", sha256=hashlib.sha256(np.stack(columns).tobytes()).hexdigest(), repeat=repeat,
        kind=plant.kind, synthetic=synthetic, reference_nm=None if reference is None else read_only(reference),
    )  # fmt: skip


def check_protocol(plant: Specimen, protocol: Protocol) -> None:
    """Refuse what cannot be recorded."""
    faults = []
    if not protocol.levels:
        faults.append("«levels»: give at least one level")
    if len(set(protocol.levels)) < len(protocol.levels):
        faults.append("«levels»: a level stands there twice; give each once and raise «repeats»")
    if plant.is_duty:
        faults += [f"«levels» {level:g}: a duty is at most 100 %" for level in protocol.levels if level > 100]
    if plant.kind != "clutch" and protocol.release_s > 0:
        faults.append("«release_s»: nobody has published how friction falls when weights are lifted; leave it at 0")
    if faults:
        raise UsageError(*faults)
    samples = (protocol.idle_s + protocol.hold_s + protocol.release_s) * protocol.rate_hz
    if protocol.hold_s * protocol.rate_hz < 10:
        raise UsageError(
            f"«hold_s» {protocol.hold_s:g}: fewer than 10 samples at {protocol.rate_hz:g} Hz; hold longer or raise "
            "«rate_hz»"
        )
    refuse_too_many(samples * protocol.repeats * len(protocol.levels))


def refuse_too_many(samples: float) -> None:
    """Refuse a set that would take minutes to write."""
    if samples > MOST_SAMPLES:
        raise UsageError(
            f"the set would hold {samples / 1e6:.4g} million samples, {MOST_SAMPLES / 1e6:g} million at most; lower "
            "the rate, the length or «repeats»"
        )
