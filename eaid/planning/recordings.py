"""A fit and the interval widths that are wanted → the session to record: levels, holds, repeats, order."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from eaid.errors import DataError, UsageError
from eaid.findings import Finding, Value, finding
from eaid.limits import check
from eaid.models.parameters import SHARE, Friction
from eaid.planning.design import PARAMETERS, Experiment, Session, level_sets, quickest
from eaid.planning.rigs import rigs
from eaid.planning.simulated import SETS, enlarged
from eaid.results.fit import Fit
from eaid.results.plan import Plan, PlannedRun
from eaid.synth.plants import Plant, clutch
from eaid.uncertainty.noise import ASSUMED, Noise, cautious, noise_of_fit

NOTICED = 0.01
"""Scatter from run to run that is named as what stands in the way of a width."""
UNITS = {"clutch": "%", "friction-force": "N", "friction-speed": "RPM"}


@dataclass(frozen=True)
class PlanOptions:
    """What is wanted, and what the rig allows."""

    want: Mapping[str, float] = field(default_factory=lambda: {"Ts": 3.0, "tau1": 5.0, "tau2": 10.0})
    """Half-widths of the 95 % intervals at the worst level [%], of Ts, tau1, tau2."""
    idle_s: float = 10.0
    """Input 0 before each step."""
    release_s: float = 10.0
    """Input 0 after each step, recorded."""
    longest_hold_s: float = 120.0
    most_levels: int = 12
    check: bool = True
    """Simulate the experiment, and enlarge it until four of five recordings keep the widths."""
    seed: int = 0


def plan_recordings(fit: Fit, options: PlanOptions | None = None, progress: Callable[[], None] | None = None) -> Plan:
    """The quickest session on the rig whose intervals are as narrow as is wanted.

    Parameters
    ----------
    fit : Fit
        What is known of the rig: its model, noise and scatter.
    options : PlanOptions, optional
        Wanted half-widths and limits of the rig.
    progress : callable, optional
        Called once per simulated recording.

    Returns
    -------
    Plan
        With a finding where a width is out of reach, or the fit is no ground to plan on.

    Raises
    ------
    UsageError
        A width of no parameter, or a limit that no rig has.
    DataError
        A fit that holds neither a nonlinear nor a friction model.
    """
    options = options or PlanOptions()
    _checked(options)
    plant, sets, share = _plant(fit)
    session = Session(options.idle_s, options.release_s, options.most_levels, options.longest_hold_s)
    known = noise_of_fit(fit, apart=True)
    degrees = fit.uncertainty.degrees_of_freedom if fit.uncertainty is not None else None
    noise = ASSUMED if known is None else cautious(known, degrees or 0.0)
    polynomial = plant.kind == "clutch"
    candidates = level_sets(sets, session.most_levels) if polynomial else [list(plant.levels)]

    def make(wanted: Mapping[str, float]) -> Experiment:
        return quickest(plant.at, candidates, wanted, noise, session, polynomial)

    measured = None
    if options.check:
        allowed = rigs(fit, plant, known or ASSUMED, SETS, options.seed)
        found, measured = enlarged(make, options.want, allowed, share, options.seed, progress)
    else:
        found = make(options.want)
    within = {**found.half_width_pct, **(measured or {})}
    over = {name: within[name] / width for name, width in options.want.items()}
    told = _doubts(fit, known)
    if max(over.values()) > 1:
        told.append(_shortfall(max(over, key=over.__getitem__), options.want, within, found, noise))
    return Plan(
        seed=options.seed,
        wanted=dict(options.want),
        met=max(over.values()) <= 1,
        levels=found.levels,
        hold_s=found.hold_s,
        repeats=found.repeats,
        time_on_rig_s=found.time_s,
        half_width_pct=_finite(found.half_width_pct),
        measured_half_width_pct=None if measured is None else _finite(measured),
        input_unit=fit.data.input_unit or UNITS[plant.kind],
        runs=run_order(found, session, options.seed),
        findings=tuple(told),
    )


def _checked(options: PlanOptions) -> None:
    wrong = [name for name, width in options.want.items() if name not in PARAMETERS or not 0 < width < 100]
    if wrong or not options.want:
        raise UsageError(
            f"«want» {', '.join(wrong)}: give a parameter of {', '.join(PARAMETERS)} and a half-width in percent, "
            "above 0 and below 100, as in tau2=10,Ts=2"
        )
    for name in ("idle", "release"):
        check(name, getattr(options, f"{name}_s"))
    check("longest_hold", options.longest_hold_s)
    check("most_levels", options.most_levels)


def _plant(fit: Fit) -> tuple[Plant, tuple[float, ...], float]:
    """The plant that a fit found, the levels or the range to plan in, and its C."""
    if fit.nonlinear is not None:
        model = fit.plant
        known = tuple(sorted({level for level in fit.data.levels if model.u_range[0] <= level <= model.u_range[1]}))
        plant = clutch(model, "a fit")
        return plant, model.u_range if model.u_range[0] < model.u_range[1] else known or model.u_range[:1], model.C
    rows = {row.level: row.curve for row in (fit.friction.levels if fit.friction is not None else ())}
    if fit.data.kind not in ("friction-force", "friction-speed") or not rows:
        raise DataError("the fit holds neither a nonlinear nor a friction model to plan with; fit again")

    def at(level: float) -> Friction:
        return rows[level]

    share = fit.friction.C if fit.friction is not None and fit.friction.C is not None else SHARE
    return Plant(fit.data.kind, at, None, tuple(rows), "a fit"), tuple(rows), share


def _doubts(fit: Fit, noise: Noise | None) -> list[Finding]:
    """What of the fit no plan can mend, or the plan has to guess."""
    told = [] if noise is not None else [finding("plan-assumes-noise", "plan")]
    decays = [one for one in fit.findings if one.code == "output-decays-under-hold"]
    told += [finding("plan-of-decaying-output", "plan", one.levels) for one in decays]
    if fit.nonlinear is not None and fit.nonlinear.identifiable is False:
        told.append(finding("plan-rests-on-a-guess", "plan"))
    return told


def _shortfall(
    name: str, wanted: Mapping[str, float], within: Mapping[str, float], found: Experiment, noise: Noise
) -> Finding:
    """Which width no experiment within the limits reaches, and what stands in the way."""
    scatter = 100 * dict(zip(PARAMETERS, noise.scatter, strict=True))[name]
    values: dict[str, Value] = {
        "parameter": name,
        "width_pct": within[name] if np.isfinite(within[name]) else None,
        "wanted_pct": wanted[name],
        "scatter_pct": scatter if scatter > 100 * NOTICED else None,
        "repeats": found.repeats,
    }
    return finding("plan-falls-short", "plan", (), **values)


def _finite(widths: Mapping[str, float]) -> dict[str, float | None]:
    return {name: float(width) if np.isfinite(width) else None for name, width in widths.items()}


def run_order(found: Experiment, session: Session, seed: int) -> tuple[PlannedRun, ...]:
    """One block a repeat, each with all levels in an order of its own: no drift or sweep hides in the levels."""
    random = np.random.default_rng(seed)
    runs: list[PlannedRun] = []
    for repeat in range(1, found.repeats + 1):
        for i in random.permutation(len(found.levels)).tolist():
            hold_s = found.hold_s[i]
            runs.append(PlannedRun(len(runs) + 1, found.levels[i], repeat, session.idle_s, hold_s, session.release_s))
    return tuple(runs)


def input_changes(runs: Sequence[PlannedRun]) -> list[tuple[float, float]]:
    """The whole session as (from when [s], input), held until the next; the last entry ends it."""
    changes, now = [(0.0, 0.0)], 0.0
    for run in runs:
        step_s, end_s = now + run.idle_s, now + run.idle_s + run.hold_s
        changes += [(step_s, run.level), (end_s, 0.0)]
        now = end_s + run.release_s
    return [*changes, (now, 0.0)]
