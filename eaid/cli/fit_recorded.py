"""`eaid fit` of logs that are fitted as they were recorded: the tables that only they have."""

from typing import TYPE_CHECKING

from eaid.cli import console
from eaid.errors import UsageError

if TYPE_CHECKING:
    from eaid.results.fit import Fit


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
