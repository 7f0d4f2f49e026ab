"""A fit and wanted widths → the shortest sequence of duties for one recording, checked by simulated recordings."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from eaid.findings import finding
from eaid.models.parameters import Nonlinear
from eaid.planning.design import Session, level_sets, quickest
from eaid.recorded.design import ExcitationPlan, plan_excitation
from eaid.recorded.sequence import Limits, check
from eaid.results.fit import Fit
from eaid.results.recorded import Excitation
from eaid.synth.planned import disturbance_of, kept, measured
from eaid.synth.plants import clutch
from eaid.uncertainty.noise import ASSUMED, Noise, noise_of_fit

SETS, KEEPING = 20, 19
"""Recordings that are simulated in each round, and how many of them keep the widths: 19/(20 + 1) = 90 %."""
ROUNDS = 5
DAMPED = 0.6
"""Power of the excess by which a width is asked for narrower: widths fall faster than their prediction."""
LEAST = 1.04
"""Least factor by which a width that was not kept is asked for narrower."""


@dataclass(frozen=True)
class ExcitationOptions:
    """What is wanted, and what the rig allows."""

    want: Mapping[str, float] = field(default_factory=lambda: {"Ts": 1.0, "tau1": 4.0, "tau2": 13.0})
    """Half-widths of the 95 % intervals at the worst duty [%], of Ts, tau1, tau2."""
    limits: Limits | None = None
    """None: the fit's own duties, no limit of the rate, rests of 5 s."""
    check: bool = True
    """Simulate the recording, and lengthen the sequence until 19 of 20 keep the widths."""
    seed: int = 0


def shortest_recording(
    fit: Fit, options: ExcitationOptions | None = None, progress: Callable[[], None] = lambda: None
) -> Excitation:
    """The shortest sequence that identifies a fit's plant to the wanted widths, and what steps would take.

    Raises
    ------
    UsageError
        A width of no parameter, or limits that leave nothing.
    DataError
        A fit without a nonlinear model.
    """
    options = options or ExcitationOptions()
    p = fit.plant
    limits = options.limits or Limits(input=p.u_range, unit=fit.data.input_unit)
    check(limits, options.want)
    known = noise_of_fit(fit)
    noise = ASSUMED if known is None else known
    found, rows = sequence_for(p, noise, options, limits, progress)
    narrow = None if rows is None else _kept_widths(rows)
    within = found.half_width_pct if narrow is None else narrow
    over = {name: within[name] / width for name, width in options.want.items()}
    worst = max(over, key=over.__getitem__)
    told = [] if known is not None else [finding("plan-assumes-noise", "plan")]
    if over[worst] > 1:
        told.append(
            finding(
                "excitation-short", "plan",
                most_s=found.time_s, parameter=worst, width_pct=within[worst], wanted_pct=options.want[worst],
            )
        )  # fmt: skip
    return Excitation(
        seed=options.seed,
        wanted=dict(options.want),
        met=over[worst] <= 1,
        time_on_rig_s=found.time_s,
        engagements=found.engagements,
        half_width_pct=found.half_width_pct,
        measured_half_width_pct=narrow
        if narrow is None
        else {k: v if np.isfinite(v) else None for k, v in narrow.items()},
        kept_pct=None if rows is None else 100 * kept(rows, dict(options.want)),
        classic_time_on_rig_s=classic_time_s(p, noise, options.want, limits),
        duty=found.breaks,
        findings=tuple(told),
    )


def sequence_for(
    p: Nonlinear, noise: Noise, options: ExcitationOptions, limits: Limits, progress: Callable[[], None] = lambda: None
) -> tuple[ExcitationPlan, list[dict[str, float]] | None]:
    """A sequence, asked for narrower until 19 of 20 simulated recordings keep the widths; those widths."""
    asked = dict(options.want)
    found = plan_excitation(p, noise, asked, limits, options.seed)
    if not options.check:
        return found, None
    rows = measured(found, p, disturbance_of(noise), SETS, options.seed, progress)
    for _ in range(ROUNDS):
        narrow = _kept_widths(rows)
        over = {name: narrow[name] / width for name, width in options.want.items()}
        if max(over.values()) <= 1 or not found.met:
            break
        asked = {
            name: width / max(LEAST, min(over[name], 3.0) ** DAMPED) if over[name] > 1 else width
            for name, width in asked.items()
        }
        found = plan_excitation(p, noise, asked, limits, options.seed)
        rows = measured(found, p, disturbance_of(noise), SETS, options.seed, progress)
    return found, rows


def _kept_widths(rows: list[dict[str, float]]) -> dict[str, float]:
    """Half-widths that `KEEPING` recordings keep [%], each parameter by itself."""
    return {name: float(np.sort([row[name] for row in rows])[KEEPING - 1]) for name in rows[0]}


def classic_time_s(p: Nonlinear, noise: Noise, want: Mapping[str, float], limits: Limits) -> float | None:
    """What steps from rest to levels, with repeats, take for the same widths [s]; None: they never reach them."""
    session = Session(10.0, 10.0, 12, 120.0)
    found = quickest(clutch(p, "a fit").at, level_sets(limits.input, 12), want, noise, session)
    return float(found.time_s) if found.met else None
