"""One run of a rig: the plant's torque (`eaid.plant.respond.driven`), and what is not the plant: noise and scatter."""

import hashlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from math import exp

import numpy as np

from eaid.arrays import Array, read_only
from eaid.errors import UsageError
from eaid.logs.run import Run
from eaid.plant.respond import driven
from eaid.replay.loop import coloured
from eaid.replay.references import MOST_SAMPLES
from eaid.synth.plants import Factors, Specimen

InputSteps = Sequence[tuple[float, float]]  # A piecewise constant input: (from when [s], value), the first at 0
Traces = tuple[Array, Array, Array]  # Time [s], input and output of a log, shapes (n,)


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


def scatter(d: Disturbance, draw: np.random.Generator) -> Factors:
    """The factors of one run."""
    gain, tau1, tau2 = draw.standard_normal(3).tolist()
    return Factors(1 + d.gain_scatter * gain, exp(d.tau1_scatter * tau1), exp(d.tau2_scatter * tau2))


def read_sensor(torque_nm: Array, time_s: Array, rotor_hz: Array, d: Disturbance, draw: np.random.Generator) -> Array:
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


def render(
    plant: Specimen, factors: Factors, steps: tuple[Array, Array], time_s: Array, disturbance: Disturbance,
    draw: np.random.Generator,
) -> Traces:  # fmt: skip
    """What one run of the rig gives where the input takes some values, each from an instant on: (instants, values)."""
    starts, levels = steps
    value = levels[np.searchsorted(starts, time_s, side="right") - 1]
    if plant.dead_time_s > 0:  # at rest until the first input acts
        starts, levels = np.append(0.0, starts + plant.dead_time_s), np.append(0.0, levels)
    torque = driven(plant.acting(factors), starts, levels, time_s)
    return time_s, value, read_sensor(torque, time_s, plant.rotor_hz(value), disturbance, draw)


def as_run(
    plant: Specimen, columns: Traces, what: str, repeat: int, synthetic: str, reference: Array | None = None
) -> Run:
    """Columns as a run that says what it is of and what made it; its fingerprint is theirs."""
    time_s, value, output = map(read_only, columns)
    return Run(
        f"synthetic-{plant.kind}-{what}-r{repeat}", time_s, value, output, plant.input_unit, plant.output_unit,
        source="eaid synth", sha256=hashlib.sha256(np.stack(columns).tobytes()).hexdigest(), repeat=repeat,
        kind=plant.kind, synthetic=synthetic, reference_nm=None if reference is None else read_only(reference),
    )  # fmt: skip


def refuse_too_many(samples: float) -> None:
    """Refuse a set that would take minutes to write."""
    if samples > MOST_SAMPLES:
        raise UsageError(
            f"the set would hold {samples / 1e6:.4g} million samples, {MOST_SAMPLES / 1e6:g} million at most; lower "
            "the rate, the length or «repeats»"
        )
