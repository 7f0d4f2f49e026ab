"""Does a planned recording give what was planned? `python -m benchmarks.plan_promise [PLANTS]`.

Each plant has T_s, τ1 and τ2 of the reference plant times e^(0.2 N). It is recorded once (ten levels, three runs of
20 s, the noise of benchmarks/coverage.py, its idle noise known), fitted and planned; then it is recorded ten times as
planned. Counted is how many recordings keep, at the worst level, what the plan stated, and what was wanted. Recordings
of one plan share what it stated: the standard error is that of the plants' own shares.
"""

import sys
from dataclasses import replace

import numpy as np

from benchmarks import coverage
from eaid.models.nonlinear import at_duty
from eaid.models.parameters import REFERENCE_PLANT, Friction
from eaid.planning import PlanOptions, plan_recordings
from eaid.planning.simulated import widths
from eaid.results.plan import Plan
from eaid.steps.stepset import Level, RunRecord, StepSet
from eaid.uncertainty.workflow import fit_steps

WHITE_NM, RATE_HZ = 0.01, 100.0
RECORDINGS = 10
"""Of each plan: a plan takes fifty times as long as a recording."""
WANT = {"Ts": 4.0, "tau1": 6.0, "tau2": 12.0}


def recorded(
    factors: np.ndarray, levels: list[float], hold_s: list[float], repeats: int, seed: int
) -> tuple[Level, ...]:
    """The plant with its factors on (T_s, τ1, τ2), recorded with the noise of the coverage benchmark."""
    random = np.random.default_rng([seed, 1])
    made = []
    for u, hold in zip(levels, hold_s, strict=True):
        base = at_duty(REFERENCE_PLANT, min(u, 100.0))
        true = Friction(base.Ts * factors[0], base.tau1 * factors[1], base.tau2 * factors[2], base.C)
        t = np.arange(round(hold * RATE_HZ)) / RATE_HZ
        colour = coverage.coloured(random, repeats, len(t), 1 / RATE_HZ)
        runs = []
        for r in range(repeats):
            gain, lag = 1 + 0.03 * random.standard_normal(), np.exp(0.05 * random.standard_normal())
            own = replace(true, Ts=true.Ts * gain, tau1=true.tau1 * lag)
            rotor = np.sin(2 * np.pi * (coverage.ROTOR_HZ * t + random.random()))
            clean = coverage.friction.step_response(own, t)
            runs.append(clean * (1 + 0.01 * colour[r] + 0.01 * rotor) + WHITE_NM * random.standard_normal(len(t)))
        made.append(Level(u, t, np.array(runs), tuple(f"{u:g}-{r}" for r in range(repeats))))
    return tuple(made)


def planned(factors: np.ndarray, seed: int) -> Plan:
    levels = coverage.LEVELS.tolist()
    record = RunRecord("r", "s", "0", 10.0, 1, 0.0, 0.0, 2000, RATE_HZ, "rising", idle_density=WHITE_NM**2 / RATE_HZ)
    made = recorded(factors, levels, [20.0] * 10, 3, seed)
    stepset = StepSet("clutch", "%", "N·m", coverage.Apparatus(), made, runs=(record,))
    return plan_recordings(fit_steps(stepset), PlanOptions(WANT, seed=seed))


def main(plants: int) -> None:
    kept: dict[str, list[float]] = {name: [] for name in WANT}
    reached: dict[str, list[float]] = {name: [] for name in WANT}
    for seed in range(plants):
        factors = np.exp(0.2 * np.random.default_rng([seed, 2]).standard_normal(3))
        plan = planned(factors, seed)
        again = []
        for k in range(1, RECORDINGS + 1):
            levels = recorded(factors, list(plan.levels), list(plan.hold_s), plan.repeats, 1000 * k + seed)
            again.append(widths(levels, 0.85, polynomial=True))
        line = f"plant {seed}: {len(plan.levels)} levels x {plan.repeats}, met {plan.met}"
        for name, width in WANT.items():
            stated = (plan.measured_half_width_pct or {})[name] or np.inf
            kept[name].append(np.mean([row[name] <= stated for row in again]))
            reached[name].append(np.mean([row[name] <= width for row in again]))
            line += f", {name} {stated:.3g} kept by {100 * kept[name][-1]:.0f} %"
        print(line, flush=True)
    for name in WANT:
        error = 100 * np.std(kept[name]) / np.sqrt(plants)
        print(
            f"{name}: {100 * np.mean(kept[name]):.0f} ± {error:.0f} % keep what is stated, "
            f"{100 * np.mean(reached[name]):.0f} % what is wanted, of {plants * RECORDINGS} recordings"
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 50)
