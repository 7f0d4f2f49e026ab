"""Logs of a clutch whose input does more than step from rest.

    staircase    all levels up and down again, each held as long
    random       levels in random order, the lowest and the highest among them; holds log-uniform
    chirp        mean + a sin of a frequency that rises geometrically
    closed-loop  the input that a PI gives on a reference, with noise in what it reads

The input is sampled at the rate of the log and held between samples; the states move exactly.
"""

from collections.abc import Callable

import numpy as np

from eaid.arrays import Array
from eaid.control.pi import PAPER_PI, PIGains
from eaid.errors import UsageError
from eaid.logs.run import Run
from eaid.options import InputOptions, RigExtras
from eaid.plant.dynamics import plant_numbers
from eaid.replay.controllers import Controller, feedback
from eaid.replay.loop import Course, inputs_of, loop_of, rig_numbers
from eaid.synth.logs import Disturbance, Traces, as_run, digits, mark, noise, refuse_too_many, render, scatter
from eaid.synth.plants import Factors, Specimen

PAPER_REFERENCE_NM = (0.6, 3.6)  # What a closed loop follows on the reference plant
FREQUENCIES_HZ = (0.05, 5.0)  # Lowest and highest of a chirp, and of the tones upon a loop's reference

Draw = np.random.Generator
LowHigh = tuple[float, float]  # The lowest and the highest


def staircase(e: InputOptions, span: LowHigh, n: int, _draw: Draw) -> Array:
    """All levels up and down again until the log ends, each for the longest hold."""
    levels = np.linspace(*span, e.levels)
    steps = np.concatenate([levels, levels[-2:0:-1]])
    hold = max(1, round(e.hold_s[1] * e.rate_hz))
    return np.asarray(np.resize(np.repeat(steps, hold), n))


def random_steps(e: InputOptions, span: LowHigh, n: int, draw: Draw) -> Array:
    """Levels in random order, every one of them once before any comes again; holds log-uniform."""
    levels = np.linspace(*span, e.levels)
    value = np.zeros(n)
    at, before = 0, -1.0
    shortest, longest = np.log(e.hold_s)
    while at < n:
        order = draw.permutation(levels)
        if order[0] == before:
            order = order[::-1]
        for level in order:
            hold = max(1, round(float(np.exp(draw.uniform(shortest, longest))) * e.rate_hz))
            value[at : at + hold] = level
            at += hold
        before = float(order[-1])
        at += round(e.rest_s * e.rate_hz)
    return value


def chirp(e: InputOptions, span: LowHigh, n: int, _draw: Draw) -> Array:
    """A sine whose frequency rises geometrically."""
    t = np.arange(n) / e.rate_hz
    first, last = FREQUENCIES_HZ
    growth = np.log(last / first) / max(float(t[-1]), 1e-9)
    phase = 2 * np.pi * first * np.expm1(growth * t) / growth
    return np.asarray(0.5 * (span[0] + span[1]) - 0.5 * (span[1] - span[0]) * np.cos(phase))


# Name → (excitation, lowest and highest input, samples, generator) → input of each sample
SEQUENCES: dict[str, Callable[[InputOptions, LowHigh, int, Draw], Array]] = {
    "staircase": staircase, "random": random_steps, "chirp": chirp,
}  # fmt: skip


def loop_reference(e: InputOptions, span: LowHigh, n: int, draw: Draw) -> Array:
    """Outputs in random order with holds as those of random steps, each with small tones upon it."""
    t = np.arange(n) / e.rate_hz
    tones = sum(np.sin(2 * np.pi * f * t + 1.7 * k * k) for k, f in enumerate(np.geomspace(*FREQUENCIES_HZ, 5)))
    return np.asarray(np.clip(random_steps(e, span, n, draw) + 0.02 * (span[1] - span[0]) * tones, *span))


def check_excitation(plant: Specimen, e: InputOptions) -> None:
    """Refuse what cannot be recorded."""
    faults = []
    if plant.model is None:
        faults.append("«excitation»: drives a clutch, whose model says what any input gives; leave it out here")
    if plant.is_duty and e.duty is not None and e.duty[1] > 100:
        faults.append(f"«shape» duty {e.duty[1]:g}: a duty ends at 100 %")
    least_hz = 2 * FREQUENCIES_HZ[1] if e.kind in ("chirp", "closed-loop") else 0.0
    if e.rate_hz < least_hz:
        faults.append(f"«rate_hz» {e.rate_hz:g}: must be {least_hz:g} Hz or more for «excitation» {e.kind}")
    if e.duration_s <= e.idle_s:
        faults.append(f"«shape» duration_s {e.duration_s:g}: must be longer than the idle time")
    if faults:
        raise UsageError(*faults)


def synthesise_excitation(
    plant: Specimen, e: InputOptions, disturbance: Disturbance, seed: int, repeats: int = 1
) -> list[Run]:
    """Logs of that input."""
    check_excitation(plant, e)
    refuse_too_many(e.duration_s * e.rate_hz * repeats)
    time_s, idle = np.arange(round(e.duration_s * e.rate_hz)) / e.rate_hz, np.zeros(round(e.idle_s * e.rate_hz))
    runs = []
    for repeat in range(1, repeats + 1):
        draw, reference = np.random.default_rng([seed, 99, repeat]), None
        factors = scatter(disturbance, draw)
        if e.kind == "closed-loop":
            columns, reference = looped(plant, e, factors, (time_s, idle), disturbance, draw)
        else:
            moved = SEQUENCES[e.kind](e, e.duty or plant.input_range, len(time_s) - len(idle), draw)
            columns = render(plant, factors, (time_s, np.append(idle, moved)), time_s, disturbance, draw)
        runs.append(as_run(plant, columns, e.kind, repeat, mark(plant, disturbance, seed), reference))
    return runs


def looped(
    plant: Specimen, e: InputOptions, factors: Factors, times: tuple[Array, Array], disturbance: Disturbance, draw: Draw
) -> tuple[Traces, Array]:
    """One log of a loop, and its reference: steps and tones; its PI reads what is logged, above its offset."""
    assert plant.model is not None  # check_excitation
    time_s, idle = times
    n = len(idle)
    low, high = PAPER_REFERENCE_NM
    reference = loop_reference(e, (low * plant.scale, high * plant.scale), len(time_s) - n, draw)
    share, white = noise(time_s, plant.rotor_hz(np.zeros_like(time_s)), disturbance, draw)
    law, dt_s = paper_pi(plant), 1 / e.rate_hz
    inputs = inputs_of(law, reference, RigExtras(), dt_s, 0)._replace(disturbance=white[n:], factor=1.0 + share[n:])
    _, read, value, _ = columns = [[0.0] * len(reference) for _ in range(4)]
    numbers = plant_numbers(factors.on(plant.model)), rig_numbers(RigExtras(), dt_s)
    loop_of(law.step)(law.gains, law.start(dt_s), *numbers, dt_s, Course(*(one.tolist() for one in inputs)), columns)
    output = digits(np.append(white[:n], read) + disturbance.offset_nm, disturbance)
    return (time_s, np.append(idle, value), output), np.append(idle, reference)


def paper_pi(plant: Specimen) -> Controller:
    """The paper's PI in the rig's units, over the inputs that the rig has."""
    top = 100.0 if plant.is_duty else plant.input_range[1]
    factor = 1.0 if plant.is_duty and plant.in_nm else top / 100 / plant.scale
    return feedback(PIGains(PAPER_PI[0] * factor, PAPER_PI[1] * factor, 0.0, top))
