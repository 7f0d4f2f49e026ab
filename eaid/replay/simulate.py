"""Controllers on the fitted plant: a scenario, a reference, the rehabilitation, or recorded runs; one function."""

from collections.abc import Sequence
from dataclasses import asdict

import msgspec

from eaid.control.defaults import scales_of
from eaid.control.plant import plant_of, why_not
from eaid.errors import DataError, UsageError
from eaid.findings import ranked
from eaid.logs.run import Run
from eaid.options import Rig, SimulateOptions
from eaid.progress import Progress, no_progress
from eaid.replay.compare import compared
from eaid.replay.references import Signal
from eaid.replay.rehab import MODES, rehabilitate
from eaid.replay.rehab_statistics import record as record_session
from eaid.replay.scenarios import reference_of
from eaid.replay.setup import Setup, set_up
from eaid.replay.tracked import Outcome, tracked
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.replay import Exercise, Head, Replay, RigRecord


def simulate(
    fit: Fit,
    gains: Gains | None = None,
    options: SimulateOptions = SimulateOptions(),  # noqa: B008 - frozen
    reference: Signal | None = None,
    runs: Sequence[Run] | None = None,
    progress: Progress = no_progress,
) -> Replay:
    """`eaid.simulate` on what has been read: a reference as time [s] and output, recorded runs; closed loops laid over.

    Raises DataError where the fit holds no plant or a run has other units than the fit, UsageError where options do
    nothing here or contradict each other.
    """
    what = "log" if runs is not None else "reference" if reference is not None else options.scenario or "multisine"
    options.check_for(what)
    scales = scales_of(fit, plant_of(fit))
    setup, doubts = set_up(fit, gains, options, what, scales)
    if runs is not None:
        records, head, more = _logs(setup, runs)
    elif what == "rehab":
        records, head, more = _rehab(setup, scales.top)
    else:
        wanted = reference_of(what if reference is None else reference, setup.dt_s, scales, options.duration)
        records, head, more = tracked(setup, wanted, gains, progress)
    head = msgspec.structs.replace(
        head, scenario=what, seed=options.seed, input_unit=fit.data.input_unit, output_unit=fit.data.output_unit,
        rig=RigRecord(**asdict(setup.rig)), perturb=dict(options.perturb), synthetic=fit.data.synthetic,
        unidentified=_unidentified(fit, gains), findings=ranked([*doubts, *more]),
    )  # fmt: skip
    return Replay(head, records)


def _unidentified(fit: Fit, gains: Gains | None) -> dict[str, str]:
    """What of a replay stands on a fit that its data do not determine, and why."""
    reasons = {"plant": why_not(fit, "nonlinear"), "gains": gains.unidentified if gains is not None else ""}
    return {name: why for name, why in reasons.items() if why}


def _rehab(setup: Setup, top: float) -> Outcome:
    """The rehabilitation of §VII with each controller, its moments scaled to what the rig can hold."""
    options = setup.options
    if setup.fit.data.output_unit not in ("N·m", "Nm"):
        raise DataError(f"rehab needs a torque, and the fit's output is in {setup.fit.data.output_unit}")
    asked = {
        "mode_s": None if options.duration is None else options.duration / len(MODES),
        "damping_nms": options.limb_damping,
        "inertia_kgm2": options.limb_inertia,
    }
    given = {key: value for key, value in asked.items() if value is not None}
    exercise = msgspec.structs.replace(Exercise().scaled(top), **given)
    records = {
        each.name: record_session(rehabilitate(setup.plant, each, exercise, setup.rig, setup.dt_s, options.seed))
        for each in setup.controllers
    }
    return records, Head("", dt_s=setup.dt_s, counted_from_s=exercise.uncounted_s, exercise=exercise), []


def _logs(setup: Setup, runs: Sequence[Run]) -> Outcome:
    """Recorded runs: their input through the plant, and over closed-loop runs the controllers replayed."""
    data, plain = setup.fit.data, asdict(Rig())
    unused = [name for name, value in asdict(setup.options.rig).items() if value != plain[name]]
    if unused and all(run.reference_nm is None for run in runs):
        raise UsageError(f"«{unused[0]}»: does nothing with logs of an open loop; leave it out")
    beside = [
        compared(run, setup.plant, setup.options.keep_baseline, (data.input_unit, data.output_unit)) for run in runs
    ]
    records = {run.name: run.difference() for run in beside}
    closed = [run for run in beside if run.reference_nm is not None]
    for run in closed:
        found = run.closed_loop(setup.plant, setup.controllers, setup.rig, setup.known.limits, setup.options.seed)
        before = f"{run.name} " if len(closed) > 1 else ""
        records |= {f"{before}{name}": one for name, one in found.items()}
    return records, Head(""), []
