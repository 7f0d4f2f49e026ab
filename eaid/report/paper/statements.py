"""Table IV, the text and the figures of the paper: the numbers that `statements.md.j2` puts into its rows."""

import itertools
from collections.abc import Mapping, Sequence
from importlib import resources
from typing import Any

import numpy as np
from jinja2 import Environment, StrictUndefined

from eaid.apparatus import Apparatus
from eaid.control import robust
from eaid.control.gains import paper_gains
from eaid.models.parameters import PAPER_LINEAR, REFERENCE_PLANT, Linear
from eaid.report import published
from eaid.report.paper.claim import ON_PLANT, UNDECIDED, Claim
from eaid.report.paper.evidence import TUNED_PI, Evidence
from eaid.report.tables import number
from eaid.results.fit import Fit
from eaid.results.friction import FrictionLevel
from eaid.results.metrics import CycleTest, ModesTest, ToneMetrics

TESTED = {("soft", "hard"): 0.001, ("soft", "assisted"): 0.005, ("hard", "assisted"): 0.005}
"""Modes whose difference the paper tests → the p that it prints."""


def statements(found: Evidence) -> list[Claim]:
    """Table IV, then §II to §VII, in the order of the paper."""
    made = Environment(undefined=StrictUndefined, trim_blocks=True)
    made.filters["n"] = number
    text = resources.files(__package__).joinpath("statements.md.j2").read_text(encoding="utf-8")
    rows = made.from_string(text).render(**of_models(found), **of_control(found), **of_rehabilitation(found))
    return [Claim.of_row(row) for row in rows.splitlines() if row.strip()]


def of_models(found: Evidence) -> dict[str, Any]:
    """§II to §IV: the apparatus, friction, the models of the clutch, Table IV."""
    force, speed = _levels(found.force), _levels(found.speed)
    gains, _pi = paper_gains()
    rpm = np.linspace(5, 40, 3501)
    at = np.array(Apparatus().stress_kpa(86.0))
    return {
        "rig": Apparatus(),
        "full": float(np.polynomial.polynomial.polyval(100.0, REFERENCE_PLANT.Ts)),
        "force": force,
        "worst_pct": 100 * max((row.rmse or 0.0) / row.Ts for row in force),
        "lowest_rpm": float(rpm[np.argmin(published.OVER_SPEED["Ts"](rpm))]),
        "span": {name: _spans(rows) for name, rows in (("force", force), ("speed", speed))},
        "at_86n": {key: float(published.OVER_STRESS[key](at)) for key in ("tau1", "tau2")},
        "at_15rpm": float(published.OVER_SPEED["tau1"](np.array(15.0))),
        "nonlinear": found.clutch.nonlinear,
        "linear": found.clutch.linear,
        "pooled_20s": found.pooled_20s,
        "pooled_60s": found.pooled_60s,
        "published_at": [f"{u:.0f}" for u in crossings(PAPER_LINEAR)],
        "refitted_at": [f"{u:.0f}" for u in crossings(found.pooled_20s.parameters)],
        "negative_below": -PAPER_LINEAR.c0 / PAPER_LINEAR.b0,
        "gains": gains,
        "honest_phi": robust.honest_phi_pct("paper", 0.05, 12.4, 42.6),
        "jump": float(1 + np.tanh(-gains.gamma * gains.epsilon)),
        "alpha": robust.alpha_formula(12.4, 42.6),
        "reached": robust.alpha_reached(12.5, 12.4, 42.6),
    }


def _levels(fit: Fit) -> tuple[FrictionLevel, ...]:
    return fit.friction.levels if fit.friction is not None else ()


def _spans(rows: Sequence[FrictionLevel]) -> dict[str, float]:
    """By how much each time constant changes over the levels [s]."""
    return {key: float(np.ptp([getattr(row, key) for row in rows])) for key in ("tau1", "tau2")}


def crossings(model: Linear) -> list[float]:
    """Duties [%] at which the linear model's steady torque is the reference plant's T_s."""
    u = np.linspace(10, 100, 90001)
    gap = (model.b0 * u + model.c0) / model.a0 - np.polynomial.polynomial.polyval(u, REFERENCE_PLANT.Ts)
    return [float(u[i]) for i in np.flatnonzero(np.diff(np.sign(gap)))]


def of_control(found: Evidence) -> dict[str, Any]:
    """§V-B, §VI and Figs. 11 to 13."""
    error = {name: one.max_abs_error_nm or np.nan for name, one in found.multisine.items()}
    tones = {name: {row.frequency_hz: row for row in one.frequencies} for name, one in found.sweep.items()}
    steps = {name: one.steps for name, one in found.steps.items()}
    # the last step falls by itself: no controller can speed it up
    rises = {name: [one.rise_time_s for one in rows[:-1] if one.rise_time_s] for name, rows in steps.items()}
    return {
        "multisine": found.multisine,
        "steps": found.steps,
        "tones": tones,
        "tuned": TUNED_PI,
        "pi_printed": found.pi_printed,
        "pi_tuned": found.pi_tuned,
        "less": {name: 100 * (1 - error["rc"] / error[name]) for name in ("pi", "pi-tuned")},
        "rise": {name: float(np.mean(values)) for name, values in rises.items()},
        "overshoot": {name: max(one.overshoot_pct or 0.0 for one in rows) for name, rows in steps.items()},
        "to_1hz_db": max(abs(row.gain_db or 0.0) for f, row in tones["rc"].items() if f <= 1.0),
        "peak": max(tones["pi"].values(), key=lambda row: row.gain_db or 0.0),
        "band": {name: _bandwidth(rows) for name, rows in tones.items()},
        "mean_error": {
            name: float(np.mean([row.mean_abs_error_nm or 0.0 for row in tones[name].values()]))
            for name in ("rc", "pi")
        },
    }


def _bandwidth(rows: Mapping[float, ToneMetrics]) -> str:
    """First crossing of −3 dB, by straight lines between tones."""
    points = sorted((f, row.gain_db or 0.0) for f, row in rows.items())
    if points[0][1] < -3:
        return f"below {points[0][0]:g} Hz"
    for (f0, g0), (f1, g1) in itertools.pairwise(points):
        if g1 < -3 <= g0:
            return f"{number(float(f0 + (f1 - f0) * (g0 + 3) / (g0 - g1)), 2)} Hz"
    return f"above {points[-1][0]:g} Hz"


def of_rehabilitation(found: Evidence) -> dict[str, Any]:
    """§VII and Figs. 16, 17, on a simulated limb, RC with the published gains, seed 0."""
    few, more = ({test.modes: test for test in part.tests} for part in (found.rehab, found.longer))
    pairs = []
    for pair, printed in TESTED.items():
        sign = "=" if pair == ("soft", "hard") else "<"
        told = _chances(few[pair], more[pair]), _verdict(few[pair].cycles, more[pair].cycles, printed)
        pairs.append((pair, f"{sign} {printed:g}", *told))
    return {"modes": found.rehab.modes, "pairs": pairs}


def _chances(few: ModesTest, more: ModesTest) -> str:
    """p by samples, and by movements of the short and of the long session."""
    p = few.samples.p
    by_samples = "< 1e−300" if p == 0 else number(p, 1)
    short, long = ([number(p, 1) for p in (one.cycles.p_welch, one.cycles.p_rank)] for one in (few, more))
    said = f"p {by_samples} by samples; {short[0]} (Welch) and {short[1]} (ranks) by {few.cycles.n[0]} movements"
    return f"{said} a mode, {long[0]} and {long[1]} by {more.cycles.n[0]}"


def _verdict(few: CycleTest, more: CycleTest, printed: float) -> str:
    """By movements, which are independent observations, as many as it takes."""
    if more.p_rank is not None and more.p_rank <= printed:
        reason = f"three movements a mode can give no rank p below {number(few.least_p_rank, 1)}"
        return f"{ON_PLANT}: samples 1 ms apart are no independent observations; {reason}, more movements decide it"
    p = f"{number(few.p_rank, 1)} and {number(more.p_rank, 1)}"
    return f"{UNDECIDED}: rank p {p}: more movements would have to decide it"
