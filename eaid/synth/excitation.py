"""Logs of a clutch whose duty does more than step from rest: staircases, random steps, PRBS, multisine, chirp, loops.

    staircase    all levels up and down again, each held as long
    random       levels in random order, the lowest and the highest among them; holds log-uniform
    prbs         two levels, switched at random at multiples of the shortest hold
    multisine    mean + Σ a sin(2π f t + φ), frequencies log-spaced, Schroeder phases
    chirp        mean + a sin of a frequency that rises geometrically
    closed-loop  the duty that a PI or another controller gives on a reference, with noise in what it reads

The input is sampled at the rate of the log and held between samples; the states move exactly.
"""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from eaid.arrays import Array, read_only
from eaid.control.pi import PIGains, pi_start, pi_step
from eaid.errors import UsageError
from eaid.limits import check as check_limit
from eaid.limits import check_all
from eaid.logs.run import Run
from eaid.replay.controllers import Controller
from eaid.replay.plant import perturbed
from eaid.synth.disturbance import Disturbance, check, coloured, measured, scatter
from eaid.synth.logs import mark, refuse_too_many
from eaid.synth.plants import Plant

LOOPED = "closed-loop"
PAPER_PI = PIGains(21.0, 360.0)
"""§V-B."""


@dataclass(frozen=True)
class Excitation:
    """How the input of one log is made; duties in %, times in s."""

    kind: str = "random"
    """A row of `KINDS`, or closed-loop."""
    duration_s: float = 240.0
    low_pct: float = 10.0
    high_pct: float = 100.0
    levels: int = 10
    """Different levels of a staircase or of random steps."""
    hold_s: tuple[float, float] = (0.5, 20.0)
    """Shortest and longest hold."""
    idle_s: float = 2.0
    """Input 0 at first."""
    rest_s: float = 0.0
    """Length of a return to 0 after every `levels` holds of random steps; 0: none."""
    frequency_hz: tuple[float, float] = (0.05, 5.0)
    """Lowest and highest frequency of a multisine or a chirp, and of a loop's reference."""
    tones: int = 12
    periods: int = 3
    """Of a multisine: so often it repeats itself."""
    reference_nm: tuple[float, float] = (0.6, 3.6)
    """Lowest and highest torque that a closed loop is to follow."""
    gains: PIGains = PAPER_PI
    rate_hz: float = 1000.0


def staircase(e: Excitation, n: int, _draw: np.random.Generator) -> Array:
    """All levels up and down again until the log ends, each for the longest hold."""
    levels = np.linspace(e.low_pct, e.high_pct, e.levels)
    steps = np.concatenate([levels, levels[-2:0:-1]])
    hold = max(1, round(e.hold_s[1] * e.rate_hz))
    return np.asarray(np.resize(np.repeat(steps, hold), n))


def random_steps(e: Excitation, n: int, draw: np.random.Generator) -> Array:
    """Levels in random order, every one of them once before any comes again; holds log-uniform."""
    levels = np.linspace(e.low_pct, e.high_pct, e.levels)
    duty = np.zeros(n)
    at, before = 0, -1.0
    shortest, longest = np.log(e.hold_s)
    while at < n:
        order = draw.permutation(levels)
        if order[0] == before:
            order = order[::-1]
        for level in order:
            hold = max(1, round(float(np.exp(draw.uniform(shortest, longest))) * e.rate_hz))
            duty[at : at + hold] = level
            at += hold
        before = float(order[-1])
        at += round(e.rest_s * e.rate_hz)
    return duty


def prbs(e: Excitation, n: int, draw: np.random.Generator) -> Array:
    """Two levels, drawn anew at every multiple of the shortest hold."""
    bit = max(1, round(e.hold_s[0] * e.rate_hz))
    bits = draw.integers(0, 2, -(-n // bit))
    return np.where(np.repeat(bits, bit)[:n] > 0, e.high_pct, e.low_pct).astype(np.float64)


def multisine(e: Excitation, n: int, _draw: np.random.Generator) -> Array:
    """Tones of one period, log-spaced, with Schroeder phases, scaled to touch both ends."""
    t = np.arange(n) / e.rate_hz
    period = n // e.periods / e.rate_hz
    lines = np.unique(np.round(np.geomspace(*e.frequency_hz, e.tones) * period))
    lines = lines[lines >= 1]
    wave = np.zeros(n)
    for k, line in enumerate(lines):
        wave += np.cos(2 * np.pi * line / period * t - np.pi * k * (k + 1) / max(len(lines), 1))
    low, high = float(wave.min()), float(wave.max())
    return np.asarray(e.low_pct + (wave - low) * ((e.high_pct - e.low_pct) / (high - low)))


def chirp(e: Excitation, n: int, _draw: np.random.Generator) -> Array:
    """A sine whose frequency rises geometrically from the lowest to the highest."""
    t = np.arange(n) / e.rate_hz
    first, last = e.frequency_hz
    growth = np.log(last / first) / max(float(t[-1]), 1e-9)
    phase = 2 * np.pi * first * np.expm1(growth * t) / growth
    return np.asarray(0.5 * (e.low_pct + e.high_pct) - 0.5 * (e.high_pct - e.low_pct) * np.cos(phase))


KINDS: dict[str, Callable[[Excitation, int, np.random.Generator], Array]] = {
    "staircase": staircase,
    "random": random_steps,
    "prbs": prbs,
    "multisine": multisine,
    "chirp": chirp,
}
"""Name → (excitation, samples, generator) → duty of each sample [%]."""


NUMBERS = ("duration_s", "idle_s", "rest_s", "tones", "periods", "rate_hz")


def check_excitation(e: Excitation, repeats: int = 1) -> None:
    """Refuse what cannot be recorded."""
    check_all(level_count=e.levels, **{name: getattr(e, name) for name in NUMBERS})
    for name in ("hold_s", "frequency_hz", "reference_nm", "gains"):
        for value in getattr(e, name)[:2]:
            check_limit(name, value)
    faults = []
    if e.kind not in (*KINDS, LOOPED):
        faults.append(f"«excitation» {e.kind}: is not one of {', '.join((*KINDS, LOOPED))}")
    if not 0 <= e.low_pct < e.high_pct <= 100:
        faults.append(f"«duty» {e.low_pct:g}:{e.high_pct:g}: give two duties that rise, from 0 to 100 %")
    if not 0 < e.hold_s[0] <= e.hold_s[1]:
        faults.append(f"«hold» {e.hold_s[0]:g}:{e.hold_s[1]:g}: give the shortest and the longest hold, above 0 s")
    if not 0 < e.frequency_hz[0] < e.frequency_hz[1] <= 0.5 * e.rate_hz:
        faults.append(f"«frequency» {e.frequency_hz[0]:g}:{e.frequency_hz[1]:g}: must rise, up to half the rate")
    if e.duration_s <= e.idle_s:
        faults.append(f"«duration» {e.duration_s:g}: must be longer than the idle time")
    refuse_too_many(e.duration_s * e.rate_hz * repeats)
    if faults:
        raise UsageError(*faults)


def synthesise_excitation(
    plant: Plant,
    e: Excitation,
    disturbance: Disturbance,
    seed: int,
    repeats: int = 1,
    controller: Controller | None = None,
) -> list[Run]:
    """Logs of that input; a closed loop takes `controller`, else the PI of the excitation's gains."""
    check_excitation(e, repeats)
    check(disturbance)
    runs = []
    for repeat in range(1, repeats + 1):
        draw = np.random.default_rng([seed, 99, repeat])
        run = (
            looped(plant, e, disturbance, draw, controller) if e.kind == LOOPED else driven(plant, e, disturbance, draw)
        )
        name = f"synthetic-{plant.kind}-{e.kind}-r{repeat}"
        runs.append(replace(run, name=name, repeat=repeat, synthetic=mark(plant, disturbance, seed)))
    return runs


def duty_of(e: Excitation, draw: np.random.Generator) -> Array:
    """Duty of every sample [%], the idle time first."""
    idle, n = round(e.idle_s * e.rate_hz), round(e.duration_s * e.rate_hz)
    return np.concatenate([np.zeros(idle), KINDS[e.kind](e, n - idle, draw)])


def driven(plant: Plant, e: Excitation, disturbance: Disturbance, draw: np.random.Generator) -> Run:
    """One log of an input that knows nothing of the torque."""
    from eaid.recorded.kernel import response  # numba, which steps from rest do without

    own = scatter(disturbance, draw)
    duty = duty_of(e, draw)
    values, index = np.unique(duty, return_inverse=True)
    curves = [own.of(plant.at(value)) for value in values.tolist()]
    share = curves[-1].C
    rest = np.clip(values / plant.rest_below, 0, 1) if plant.rest_below > 0 else np.ones_like(values)
    torque = np.empty(len(duty))
    scalars = np.array([share, *(plant.release or (0.0, 0.0)), 1.0, 1.0, 0.0, 0.0])
    response(
        np.full(len(duty), 1 / e.rate_hz), index.astype(np.int64), np.ones(len(duty), dtype=np.int64),
        np.array([c.Ts for c in curves]), np.array([c.tau1 for c in curves]), np.array([c.tau2 for c in curves]),
        rest, scalars, np.zeros(2), torque,
    )  # fmt: skip
    time_s = np.asarray(np.arange(len(duty)) / e.rate_hz, dtype=np.float64)
    rotor = np.full(len(duty), (plant.rotor_rpm or 10.0) / 60)
    return _run(time_s, duty, measured(torque, time_s, rotor, disturbance, draw), None)


def looped(
    plant: Plant,
    e: Excitation,
    disturbance: Disturbance,
    draw: np.random.Generator,
    controller: Controller | None = None,
) -> Run:
    """One log of a loop: steps and tones of torque between the two given ones; the controller reads what is logged."""
    from eaid.recorded.law import run_loop

    if plant.model is None:
        raise UsageError("a closed loop needs the clutch's own model; give a plant of the clutch")
    own = scatter(disturbance, draw)
    idle = round(e.idle_s * e.rate_hz)
    n = round(e.duration_s * e.rate_hz) - idle
    reference = reference_of(e, n, draw)
    model = perturbed(plant.model, {"Ts": own.gain, "tau1": own.tau1, "tau2": own.tau2})
    dt_s = 1 / e.rate_hz
    share = np.zeros(n)
    if disturbance.coloured > 0:
        share += disturbance.coloured * coloured(n, dt_s, disturbance.coloured_s, draw)
    if disturbance.ripple > 0:
        phase = draw.uniform(0, 2 * np.pi)
        share += disturbance.ripple * np.sin(2 * np.pi * (plant.rotor_rpm or 10.0) / 60 * dt_s * np.arange(n) + phase)
    white = disturbance.white_nm * draw.standard_normal(n + idle)
    acting = controller or Controller("pi", pi_step, e.gains, pi_start())
    duty, seen = run_loop(model, acting, reference, dt_s, share, white[idle:])
    duty, reference = np.concatenate([np.zeros(idle), duty]), np.concatenate([np.zeros(idle), reference])
    torque = np.concatenate([white[:idle], seen]) + disturbance.offset_nm
    if disturbance.resolution_nm > 0:
        torque = np.round(torque / disturbance.resolution_nm) * disturbance.resolution_nm
    return _run(np.arange(n + idle, dtype=np.float64) * dt_s, duty, torque, reference)


def reference_of(e: Excitation, n: int, draw: np.random.Generator) -> Array:
    """Torques in random order with holds as those of random steps, each with small tones upon it [N·m]."""
    low, high = e.reference_nm
    levels = replace(e, low_pct=low, high_pct=high, rest_s=0.0)
    held = random_steps(levels, n, draw)
    t = np.arange(n) / e.rate_hz
    tones = sum(np.sin(2 * np.pi * f * t + 1.7 * k * k) for k, f in enumerate(np.geomspace(*e.frequency_hz, 5)))
    return np.asarray(np.clip(held + 0.02 * (high - low) * tones, low, high))


def _run(time_s: Array, duty: Array, torque: Array, reference: Array | None) -> Run:
    return Run(
        name="synthetic",
        time_s=read_only(time_s),
        input=read_only(duty),
        output=read_only(torque),
        input_unit="%",
        output_unit="N·m",
        source="eaid synth",
        sha256=hashlib.sha256(np.stack([time_s, duty, torque]).tobytes()).hexdigest(),
        reference_nm=None if reference is None else read_only(reference),
        kind="clutch",
    )
