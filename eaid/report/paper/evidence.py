"""All that the table of the paper rests on, computed once: fits of the shipped data, the reference plant, replays."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from eaid.apparatus import Apparatus
from eaid.arrays import read_only
from eaid.control.gains import paper_gains
from eaid.control.pi import PIGains, PIState, pi_step
from eaid.control.pi_design import StepMetrics, step_metrics
from eaid.fitting.fit import fit
from eaid.logs.options import ReadOptions
from eaid.logs.read import read_runs
from eaid.logs.run import INPUT_UNITS
from eaid.models import friction as curve
from eaid.models import nonlinear
from eaid.models.parameters import PAPER_LINEAR, REFERENCE_PLANT
from eaid.replay import references
from eaid.replay.controllers import Controller, Knowledge, controller
from eaid.replay.loop import replay
from eaid.replay.plant import plant_parameters
from eaid.replay.references import Reference
from eaid.replay.rehab import rehabilitate
from eaid.replay.rehab_statistics import statistics
from eaid.replay.rig import Rig
from eaid.replay.scenarios import measure
from eaid.results.fit import Fit, FitOptions
from eaid.results.linear import Linear
from eaid.results.metrics import Metrics
from eaid.results.replay import Exercise
from eaid.steps.build import build_stepset
from eaid.steps.cut_runs import StepOptions
from eaid.steps.stepset import Level, StepSet
from eaid.synth.datasets import shipped
from eaid.synth.plants import REFERENCE
from eaid.uncertainty.workflow import fit_steps

DT_S = 1e-3
SEED = 0
TUNED_PI = (156.6, 252.9)
"""K_P and K_I that do give 1 % overshoot and 0.27 s on the published linear model."""


LONGER_S = 75.0
"""Length of a mode with ten whole movements [s], enough for tests on movements to show what three cannot."""


@dataclass(frozen=True)
class Evidence:
    """What was computed."""

    force: Fit
    """Of the shipped friction-force dataset."""
    speed: Fit
    clutch: Fit
    exact: Mapping[str, Fit]
    """Fits of noise-free steps: friction-force by Table I, friction-speed by Table II, clutch of the plant."""
    pooled_20s: Linear
    """Linear model of the noise-free reference plant, levels 10…100 %, 20 s at 1 kHz."""
    pooled_60s: Linear
    """The same with levels 30…100 % and 60 s, as the paper's Fig. 7 leaves the lowest out."""
    pi_printed: StepMetrics
    """Overshoot [%] and settling time [s] of K_P = 21, K_I = 360 on the published linear model."""
    pi_tuned: StepMetrics
    multisine: Mapping[str, Metrics]
    """rc, pi and pi-tuned with the published gains on the reference plant, noise-free."""
    steps: Mapping[str, Metrics]
    sweep: Mapping[str, Metrics]
    rehab: Metrics
    """The session as published, 30 s a mode: three whole movements count in each."""
    longer: Metrics
    """The same with `LONGER_S` a mode."""


def evidence(done: Callable[[], None] = lambda: None) -> Evidence:
    """Compute it all, some seconds; `done` is called after each of the `PARTS`."""
    found = {}
    for name, computed in PARTS.items():
        found[name] = computed()
        done()
    return Evidence(**found)


def noise_free(kind: str) -> Fit:
    """Fit of noise-free steps of what the shipped logs of that kind are made of: 60 s at 200 Hz, the same levels."""
    plant = REFERENCE[kind]()
    t = read_only(np.arange(12_000) * 5e-3)
    rows = tuple(Level(u, t, curve.step_response(plant.at(u), t)[None], (f"{u:g}",)) for u in plant.levels)
    rig = Apparatus(surfaces=2 if kind == "clutch" else 1)
    stepset = StepSet(kind, INPUT_UNITS[kind], "N·m", rig, rows, synthetic=plant.made_of)
    return fit(stepset, FitOptions())


def _shipped(kind: str) -> Fit:
    return fit_steps(build_stepset(read_runs([shipped()[kind]], ReadOptions()), StepOptions()), FitOptions())


def pooled(levels: tuple[int, ...], hold_s: float) -> Linear:
    """The paper's linear procedure on noise-free steps of the reference plant at 1 kHz."""
    t = read_only(np.arange(round(hold_s / DT_S)) * DT_S)
    rows = tuple(
        Level(float(u), t, nonlinear.step_response(REFERENCE_PLANT, t, float(u))[None], (f"{u}",)) for u in levels
    )
    stepset = StepSet("clutch", "%", "N·m", Apparatus(), rows, synthetic="the reference plant, noise-free")
    found = fit(stepset, FitOptions(models=("linear",))).linear
    assert found is not None
    return found


RC, PI = paper_gains()
TUNED = PIGains(*TUNED_PI)
KNOWN = Knowledge(REFERENCE_PLANT, PAPER_LINEAR, RC, PI)
PLANT = plant_parameters(REFERENCE_PLANT)


def _replays(made: Callable[[float], Reference], *names: str, **pis: PIGains) -> dict[str, Metrics]:
    """Metrics of RC, of other controllers and of some PIs, noise-free."""
    reference = made(DT_S)
    acting = {name: controller(name, KNOWN) for name in ("rc", *names)}
    acting |= {name.replace("_", "-"): Controller(name, pi_step, gains, PIState()) for name, gains in pis.items()}
    return {
        name: measure(replay(PLANT, one, reference.torque_nm, Rig(), DT_S, SEED), reference)
        for name, one in acting.items()
    }


def _session(exercise: Exercise) -> Metrics:
    return statistics(rehabilitate(PLANT, controller("rc", KNOWN), exercise, Rig(), DT_S, SEED))


PARTS: Mapping[str, Callable[[], Any]] = {
    "force": partial(_shipped, "friction-force"),
    "speed": partial(_shipped, "friction-speed"),
    "clutch": partial(_shipped, "clutch"),
    "exact": lambda: {kind: noise_free(kind) for kind in ("friction-force", "friction-speed", "clutch")},
    "pooled_20s": partial(pooled, tuple(range(10, 101, 10)), 20.0),
    "pooled_60s": partial(pooled, tuple(range(30, 101, 10)), 60.0),
    "pi_printed": partial(step_metrics, PAPER_LINEAR, PI.K_P, PI.K_I),
    "pi_tuned": partial(step_metrics, PAPER_LINEAR, *TUNED_PI),
    "multisine": partial(_replays, references.multisine, pi=PI, pi_tuned=TUNED),
    "steps": partial(_replays, references.steps, pi=PI, pi_tuned=TUNED),
    "sweep": partial(_replays, references.sweep, "open-loop", pi=PI),
    "rehab": partial(_session, Exercise()),
    "longer": partial(_session, Exercise(mode_s=LONGER_S)),
}
"""Each part of the evidence and what computes it."""
