"""Tables of single steps: each change of input with its gain and shape, and slips under a held input."""

from eaid.report.tables.table import Cell, Name, Table, columns, level
from eaid.results.fit import Fit
from eaid.steps.stepset import StepSet

SHAPES = {"one": "one exponential", "two": "two exponentials", "free": "two, C free", "overshoot": "overshoot"}


def steps_table(fit: Fit) -> Table:
    """One row a change of input between two holds, over the level, up first."""
    unit, out = fit.data.input_unit or "input", fit.data.output_unit
    rows: list[tuple[Cell, ...]] = [
        (
            Name(f"{level(one.from_)} → {level(one.level)}"), one.start, one.change, one.gain, SHAPES[one.shape],
            one.tau1, one.tau2, one.C, one.dead_time_s, one.rmse, one.fit_pct,
        )
        for one in fit.steps
    ]  # fmt: skip
    heads = columns(
        ("step", unit), ("start", out), ("change", out), ("gain", f"{out}/{unit}"), "shape", ("τ1", "s"), ("τ2", "s"),
        ("C", "", 3), ("dead time", "s", 3), ("RMSE", out, 3), ("fit", "%", 3),
    )  # fmt: skip
    return Table(
        "Steps, each from its own start", "The shape is the one that the evidence asks for.", heads, tuple(rows)
    )


def slips_table(data: StepSet) -> Table:
    """One row a run whose output peaks and slips while its input is held."""
    out = data.output_unit
    rows: list[tuple[Cell, ...]] = []
    for run in data.runs:
        if run.slip is not None:
            one = run.slip
            stick: tuple[Cell, ...] = (one.stick_slip, one.stick_slip_hz)
            rows.append(
                (Name(run.name), level(run.level), one.peak, one.peak_s, one.after, one.stiffness_per_s, *stick)
            )
    heads = columns(
        "run", ("level", data.input_unit), ("peak", out, 3), ("at", "s", 3), ("after it", out, 3),
        ("loading", f"{out}/s", 3), ("stick-slip", out, 3), ("at", "Hz", 3),
    )  # fmt: skip
    said = "Peak, level after the slip, slope of the loading, and what sticks and slips behind it, peak to peak."
    return Table("Slips", f"{said} At a constant speed v the displacement is v times the time.", heads, tuple(rows))
