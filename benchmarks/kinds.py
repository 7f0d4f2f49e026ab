"""Intervals of each kind of lag on simulated logs: how often they hold the truth, how often evidence finds the kind.

`python -m benchmarks.kinds 40`: so many logs a kind, random steps of 60 s at 50 Hz, 5 % of noise, white and of first
order with a memory of 0.2 s in turn. Coverage of nominal 95 % intervals where the right kind was chosen; chance alone
makes ± 3 % of a hundred.
"""

import sys
from collections import defaultdict

import numpy as np

from eaid.arrays import Array
from eaid.errors import EaidError
from eaid.estimate.recorded_log import RecordedLog
from eaid.options import FitOptions
from eaid.plant.dynamics import Plant
from eaid.plant.respond import respond
from eaid.recorded.fit import fit_recorded


def plant(tau1: float, tau2: float = 1.0, **more: float) -> Plant:
    """A plant of gain 1."""
    return Plant((tau1,), (tau2,), (0.0, 1.0), (0.0, 1.0), floor_s=0.0, **more)  # type: ignore[arg-type]


KINDS = {
    "lag": plant(0.8, C=1.0),
    "lag+dead": plant(0.8, C=1.0, dead_time_s=0.253),
    "series": plant(0.6, zeta=1.4),
    "series+dead": plant(0.6, zeta=1.4, dead_time_s=0.317),
    "ringing": plant(0.3, zeta=0.2),
    "ringing+dead": plant(0.3, zeta=0.2, dead_time_s=0.253),
    "overshoot": plant(0.4, 2.0, C=1.6),
}
LEVELS = (0.0, 0.3, 0.6, 1.0)


def log_of(p: Plant, seed: int) -> RecordedLog:
    """One log."""
    random, t = np.random.default_rng(seed), np.arange(3000) * 0.02
    u = np.zeros(t.size)
    at = 50
    while at < t.size:
        held = int(np.exp(random.uniform(np.log(25), np.log(250))))
        u[at : at + held] = random.choice(LEVELS)
        at += held
    noise: Array = random.normal(size=t.size)
    if seed % 2:
        keep = np.exp(-0.02 / 0.2)
        for k in range(1, t.size):
            noise[k] = keep * noise[k - 1] + np.sqrt(1 - keep**2) * noise[k]
    return RecordedLog("log", t, u, 3.0 + respond(p, t, u, t) + 0.05 * noise)


def truths(p: Plant) -> dict[str, float]:
    """What an interval is quoted of."""
    tau1, tau2 = (float(one) for one in p.time_constants(1.0))
    found = {"gain": 1.0}
    if p.kind == "ringing":
        found |= {"omega": 1 / p.tau1[0], "zeta": float(p.zeta or 0.0)}
    else:
        found |= {"tau1": tau1} if p.kind == "lag" else {"tau1": tau1, "tau2": tau2}
    if p.kind == "overshoot":
        found["C"] = p.C
    return found | ({"dead_time_s": p.dead_time_s} if p.dead_time_s else {})


def main(count: int) -> None:
    """Print one line a kind."""
    print(f"{'kind':14s} right  coverage of each number")
    for name, p in KINDS.items():
        held: dict[str, list[bool]] = defaultdict(list)
        right = 0
        for seed in range(count):
            try:
                part = fit_recorded([log_of(p, seed)], FitOptions(model=("nonlinear",)), falls=False).plant_
            except EaidError:
                continue
            if (
                part is None
                or part.ci95 is None
                or part.kind != p.kind
                or bool(part.dead_time_s) != bool(p.dead_time_s)
            ):
                continue
            right += 1
            for key, true in truths(p).items():
                ends = getattr(part.ci95, key)
                held[key].append(ends is not None and ends[0] <= true <= ends[1])
        told = "  ".join(f"{key} {100 * np.mean(inside):.0f}" for key, inside in held.items())
        print(f"{name:14s} {right:3d}/{count}  {told}", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
