"""A fit and wanted widths → the shortest sequence of inputs for one recording, checked by simulated recordings."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from eaid.errors import DataError
from eaid.findings import finding
from eaid.limits import check_all
from eaid.models.parameters import Nonlinear
from eaid.planning import played
from eaid.planning.design import Session
from eaid.planning.enlarge import Widths, enlarged, finite, kept_widths, over
from eaid.planning.recordings import refuse_widths
from eaid.planning.rigs import rig_of
from eaid.recorded.design import ExcitationPlan, plan_excitation
from eaid.recorded.sequence import Limits, refuse_scattered
from eaid.results.fit import Fit
from eaid.results.recorded import Excitation
from eaid.uncertainty.rig_noise import Noise

SETS, KEEPING = 20, 19 / 21
"""Recordings that are simulated of each sequence, and the probability that a recording keeps a width: 19 of 20 do."""


@dataclass(frozen=True)
class ExcitationOptions:
    """What is wanted, and what the rig allows."""

    want: Mapping[str, float] = field(default_factory=lambda: {"Ts": 1.0, "tau1": 4.0, "tau2": 13.0})
    """Half-widths of the 95 % intervals at the worst input [%], of Ts, tau1, tau2."""
    limits: Limits | None = None
    """None: the fit's own range of the input, no limit of the rate, rests of 5 s."""
    check: bool = True
    """Simulate the recording, and lengthen the sequence until 19 of 20 keep the widths."""
    seed: int = 0


def shortest_recording(
    fit: Fit, options: ExcitationOptions | None = None, progress: Callable[[], None] = lambda: None
) -> Excitation:
    """The shortest sequence that identifies a fit's plant to the wanted widths: what `eaid.plan_excitation` calls.

    `UsageError` for a width of no parameter or one that the scatter keeps out of reach, and for limits that leave
    nothing; `DataError` for a fit without a nonlinear model.
    """
    options = options or ExcitationOptions()
    check_all(seed=options.seed)
    refuse_widths(options.want)
    if fit.nonlinear is None:
        raise DataError("the fit holds no nonlinear model, which a sequence is planned with; fit clutch logs with it")
    rig = rig_of(fit)
    refuse_scattered(rig.noise, options.want)
    limits = options.limits or Limits(input=fit.plant.u_range, unit=rig.plant.input_unit)
    plan, rows = sequence_for(fit.plant, rig.noise, options, limits, progress)
    measured = None if rows is None else kept_widths(rows, KEEPING)
    widths = measured or plan.half_width_pct
    excess = over(widths, options.want)
    worst = max(excess, key=excess.__getitem__)
    findings = [] if rig.known else [finding("plan-assumes-noise", "plan")]
    if excess[worst] > 1:
        findings.append(
            finding(
                "excitation-short", "plan",
                most_s=plan.time_s, parameter=worst, width_pct=widths[worst], wanted_pct=options.want[worst],
            )
        )  # fmt: skip
    steps = replace(rig, levels=limits.input).quickest(options.want, Session())
    return Excitation(
        seed=options.seed,
        wanted=dict(options.want),
        met=excess[worst] <= 1,
        time_on_rig_s=plan.time_s,
        engagements=plan.engagements,
        half_width_pct=plan.half_width_pct,
        measured_half_width_pct=None if measured is None else finite(measured),
        kept_pct=None if rows is None else 100 * kept_share(rows, options.want),
        classic_time_on_rig_s=steps.time_s if steps.met else None,
        input_unit=rig.plant.input_unit,
        duty=plan.breaks,
        findings=tuple(findings),
    )


def sequence_for(
    p: Nonlinear, noise: Noise, options: ExcitationOptions, limits: Limits, progress: Callable[[], None] = lambda: None
) -> tuple[ExcitationPlan, list[Widths] | None]:
    """A sequence, and the widths of simulated recordings; longer until 19 of 20 keep what is wanted."""

    def make(wanted: Mapping[str, float]) -> ExcitationPlan:
        return plan_excitation(p, noise, wanted, limits, options.seed)

    def measure(plan: ExcitationPlan) -> list[Widths]:
        return played.measure(plan, p, noise, SETS, options.seed, progress)

    return enlarged(make, measure, options.want, KEEPING) if options.check else (make(options.want), None)


def kept_share(rows: list[Widths], wanted: Mapping[str, float]) -> float:
    """Part of the recordings whose widths are all within the wanted ones."""
    return sum(max(over(row, wanted).values()) <= 1 for row in rows) / len(rows)
