"""`eaid fit` of logs that are fitted as they were recorded: their options, and the tables that only they have."""

from typing import TYPE_CHECKING

from eaid.cli import console
from eaid.errors import UsageError

if TYPE_CHECKING:
    from eaid.fitting.options import FitOptions
    from eaid.results.fit import Fit
    from eaid.steps.stepset import StepSet


def as_recorded(stepset: "StepSet", options: "FitOptions", rest: float, duty: str | None, instrument: bool) -> "Fit":
    """The fit of a set's recorded logs, with its steps."""
    import msgspec

    from eaid.findings import ranked
    from eaid.fitting.between import single_steps
    from eaid.recorded.fit import fit_recorded
    from eaid.recorded.options import RecordedOptions

    for name, value, plain in (("weights", options.weights, "equal"), ("loss", options.loss, "squares")):
        if value != plain:
            raise UsageError(f"«{name}» {value}: logs fitted as recorded take {plain}; or say «logs_as» steps")
    if options.hold_out:
        raise UsageError("«hold_out»: logs fitted as recorded hold no single levels; or say «logs_as» steps")
    how = RecordedOptions(
        models=options.models,
        share=options.share,
        u_range=duty_of(duty),
        rest=rest,
        instrument=instrument,
        ci="none" if options.ci == "none" else "robust",
        seed=options.seed,
    )
    found = fit_recorded(stepset.recorded, how, stepset if stepset.levels else None)
    shapes = single_steps(stepset, options)
    told = (said for one in shapes for said in one.findings)
    return msgspec.structs.replace(found, steps=shapes, findings=ranked((*found.findings, *told)))


def duty_of(text: str | None) -> tuple[float, float] | None:
    """`10:100` as two numbers."""
    if text is None:
        return None
    try:
        low, high = (float(part) for part in text.split(":"))
    except ValueError:
        raise UsageError(f"«duty» {text}: write the lowest and the highest input, as 10:100") from None
    return low, high


def recorded_tables(fit: "Fit") -> None:
    """Logs as recorded, and closed loops."""
    assert fit.recorded is not None
    unit = fit.data.output_unit
    console.table(
        "Logs as recorded",
        ["log", "input", "samples", "idle", f"RMSE [{unit}]", "free run [%]", "one step [%]"],
        [
            [
                log.name,
                log.input_kind,
                str(log.samples),
                *map(_number, (log.idle, log.rmse, log.fit_pct, log.one_step_pct)),
            ]
            for log in fit.recorded.logs
        ],
    )  # fmt: skip
    if fit.recorded.loops:
        console.table(
            "Closed loops",
            ["log", "K_P", "K_I", "saturated [%]", "rms error", "predicted", "gain margin [dB]", "phase margin [°]"],
            [
                [
                    loop.name,
                    *map(
                        _number,
                        (
                            loop.K_P, loop.K_I, 100 * loop.saturated_fraction, loop.rms_error,
                            loop.predicted_rms_error, loop.gain_margin_db, loop.phase_margin_deg,
                        ),
                    ),
                ]
                for loop in fit.recorded.loops
            ],
        )  # fmt: skip


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"
