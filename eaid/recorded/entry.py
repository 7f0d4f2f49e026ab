"""A step set with recorded logs, and the options of step fits → the fit of its recorded logs, with its steps."""

import msgspec

from eaid.errors import UsageError
from eaid.findings import ranked
from eaid.recorded.fit import fit_recorded
from eaid.recorded.options import RecordedOptions
from eaid.results.fit import Fit, FitOptions
from eaid.steps.stepset import StepSet
from eaid.uncertainty.workflow import asked, shapes_of


def fit_whole(
    stepset: StepSet, options: FitOptions, duty: tuple[float, float] | None = None, instrument: bool = False
) -> Fit:
    """Fit the recorded logs of a set with its steps.

    Raises
    ------
    UsageError
        Options that only steps have: weights, a loss, held-out levels.
    DataError
        A log that no model can be fitted to.
    """
    for name, value, plain in (("weights", options.weights, "equal"), ("loss", options.loss, "squares")):
        if value != plain:
            raise UsageError(f"«{name}» {value}: logs fitted as recorded take {plain}; or say «logs_as» steps")
    if options.hold_out:
        raise UsageError("«hold_out»: logs fitted as recorded hold no single levels; or say «logs_as» steps")
    how = RecordedOptions(
        models=options.models,
        share=options.held_share,
        u_range=duty,
        rest=float(stepset.reading.get("rest", 0.0)),
        instrument=instrument,
        ci="none" if options.ci == "none" else "robust",
        seed=options.seed,
    )
    found = fit_recorded(stepset.recorded, how, stepset if stepset.levels else None)
    shapes = shapes_of(stepset, options)
    doubts = tuple(said for one in shapes for said in one.findings)
    return msgspec.structs.replace(
        found, options=asked(options, stepset), steps=shapes, findings=ranked((*found.findings, *doubts))
    )
