"""Tables of replays: errors of each controller, steps and tones, drawn plants, logs, rehabilitation."""

from collections.abc import Sequence

from eaid.report.results import Given
from eaid.report.style import controller_name
from eaid.report.tables.table import Cell, Column, Name, Table, columns, level, number
from eaid.results.metrics import Metrics
from eaid.results.replay import Replay

METRICS = {
    "max_abs_error_nm": ("largest |error|", "out"),
    "rms_error_nm": ("RMS error", "out"),
    "mean_abs_error_nm": ("mean |error|", "out"),
    "mean_abs_duty_step_pct": ("mean input step", "in"),
    "saturated_fraction": ("share at a limit", ""),
}
SCENARIO_NAMES = {
    "steps": "steps", "multisine": "sum of sines", "sweep": "sines of rising frequency", "ramp": "ramp up and down",
    "reference": "own reference", "log": "recorded input", "rehab": "rehabilitation",
}  # fmt: skip


def _heads(replay: Replay) -> list[Column]:
    units = {"out": replay.head.output_unit, "in": replay.head.input_unit, "": ""}
    return [Column(said, units[kind], 3) for said, kind in METRICS.values()]


def metric(replay: Replay, name: str, key: str) -> float | None:
    """One number of one controller; errors of the whole trace where the file says none."""
    one = replay.records[name]
    known: float | None = getattr(one.metrics, key)
    if known is not None or key not in ("max_abs_error_nm", "mean_abs_error_nm"):
        return known
    error = abs(one.columns["reference_nm"] - one.columns["torque_nm"])
    return float(error.max() if key == "max_abs_error_nm" else error.mean())


def replays_table(replays: Sequence[Given[Replay]]) -> Table:
    """Errors and input of each controller, all scenarios in one table."""
    rows: list[tuple[Cell, ...]] = []
    for one in replays:
        said = SCENARIO_NAMES.get(one.result.head.scenario, one.result.head.scenario or "own reference")
        rows += [
            (said, controller_name(name), *(metric(one.result, name, key) for key in METRICS))
            for name in one.result.records
        ]
    caption = "Errors are reference minus true output; the settling time at the start is left out where the scenario "
    heads = (Column("replay"), Column("controller"), *_heads(replays[0].result))
    return Table("Errors of each controller", f"{caption}has one.", heads, tuple(rows))


def log_table(replay: Replay) -> Table:
    """How far the model is from each recorded run when it gets the recorded input."""
    rows: list[tuple[Cell, ...]] = []
    for name, known in replay.metrics("recorded-input").items():
        differences = (known.rms_difference_nm, known.max_abs_difference_nm, known.mean_difference_nm)
        rows.append((Name(name), *differences, known.R2, known.fit_pct, known.one_step_pct))
    out = replay.head.output_unit
    heads = columns(
        "run", ("RMS difference", out, 3), ("largest", out, 3), ("mean, recorded − model", out, 3), "R²",
        ("free-run fit", "%", 3), ("one-step fit", "%", 3),
    )  # fmt: skip
    said = "Each log's own input drives the model: free run, and from each measured sample to the next."
    return Table("Recorded input through the model", said, heads, tuple(rows))


def plants_table(replay: Replay) -> Table:
    """Spread of the numbers over plants drawn from the fit's uncertainty; no rows where none were drawn."""
    rows: list[tuple[Cell, ...]] = []
    units = {"out": replay.head.output_unit, "in": replay.head.input_unit, "": "1"}
    for name, record in replay.records.items():
        drawn = record.metrics.plants.metrics if record.metrics.plants else {}
        for key, (said, kind) in METRICS.items():
            if one := drawn.get(key):
                said_of = f"{controller_name(name)}: {said} ({units[kind]})"
                rows.append((said_of, one.low, one.median, one.high, one.worst.value))
    caption = f"{replay.head.plants} plants drawn from the fit's uncertainty; the figure's shaded band holds "
    heads = columns("number", ("2.5 %", "", 3), ("median", "", 3), ("97.5 %", "", 3), ("worst", "", 3))
    return Table(f"Over drawn plants: {replay.head.scenario}", f"{caption}95 % of them.", heads, tuple(rows))


def steps_table(replay: Replay) -> Table:
    """Rise, overshoot and settling of each step."""
    rows: list[tuple[Cell, ...]] = []
    for name, record in replay.records.items():
        for step in record.metrics.steps:
            change = f"{level(step.from_nm)} → {level(step.to_nm)}"
            rows.append((controller_name(name), change, step.rise_time_s, step.overshoot_pct, step.settling_s))
    caption = "Rise from 10 to 90 %; settling to within 2 % of the step; a dash where the next step comes first."
    heads = columns(
        "controller", ("step", replay.head.output_unit), ("rise time", "s", 3), ("overshoot", "%", 3),
        ("settling time", "s", 3),
    )  # fmt: skip
    return Table("Each step", caption, heads, tuple(rows))


def tones_table(replay: Replay) -> Table:
    """Amplitude and phase of each tone of a sweep."""
    rows = tuple(
        (controller_name(name), row.frequency_hz, row.gain_db, row.phase_deg, row.mean_abs_error_nm)
        for name, record in replay.records.items()
        for row in record.metrics.frequencies
    )
    caption = "Amplitude and phase of the output against the reference, at the sine's own frequency."
    heads = columns(
        "controller", ("frequency", "Hz", 3), ("amplitude", "dB", 3), ("phase", "°", 3),
        ("mean |error|", replay.head.output_unit, 3),
    )  # fmt: skip
    return Table("Each frequency", caption, heads, rows)


def rehab_tables(replay: Replay) -> list[Table]:
    """Errors by mode, tests between modes, normality."""
    order = sorted(replay.records, key=lambda name: name != "rc")
    numbers = next((m for name in order if (m := replay.records[name].metrics).modes), Metrics())
    found = []
    rows: list[tuple[Cell, ...]] = []
    for mode, part in numbers.modes.items():
        box = part.abs_position_error_deg
        half = f"{number(box.q1, 3)} … {number(box.q3, 3)}"
        rows.append((mode, box.median, half, box.mean, part.mean_abs_torque_error_nm, number(box.independent, 2)))
    if rows:
        heads = columns(
            "mode", ("median", "°", 3), "middle half (°)", ("mean", "°", 3),
            ("mean error of the output", replay.head.output_unit, 2), "independent observations",
        )  # fmt: skip
        caption = "Absolute position error; the last column says how many independent observations the samples are "
        found.append(Table("Errors by mode", f"{caption}worth.", heads, tuple(rows)))
    tests: list[tuple[Cell, ...]] = []
    for test in numbers.tests:
        chances = (_chance(p) for p in (test.samples.p, test.cycles.p_welch, test.cycles.p_rank))
        tests.append((" and ".join(test.modes), *chances, number(test.cycles.least_p_rank, 2)))
    if tests:
        caption = "Probability (p) of such a difference by chance. The paper's test takes every millisecond as a new "
        caption += "observation, which it is not; the other two use one mean per movement, and the last column is the "
        caption += "least p that so few movements can give."
        heads = columns("modes", "p, all samples (paper)", "p, means, Welch", "p, means, ranks", "least p of ranks")
        found.append(Table("Do the modes differ?", caption, heads, tuple(tests)))
    normal = tuple(
        (mode, _chance(part.p), "not normal" if part.rejected else "may be normal")
        for mode, part in numbers.normality.items()
    )
    if normal:
        caption = "A small p rejects normality; the paper reads its p < 0.001 the other way round."
        found.append(Table("Are the errors normal?", caption, columns("mode", "p", "verdict"), normal))
    return found


def _chance(p: float | None) -> str:
    """A probability; below what a double can hold it is said to be so."""
    return "< 1e−300" if p == 0 else number(p, 2)
