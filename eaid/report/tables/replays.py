"""Tables of replays, for page and terminal: errors, guarantee, steps, tones, drawn plants, logs, modes."""

from collections.abc import Iterable, Sequence

from eaid.report.rig import controller_name
from eaid.report.tables import Cell, Column, Name, Table, columns, level, number
from eaid.results.replay import Metrics, Replay

METRICS = {
    "max_abs_error_nm": ("largest |error|", "out"),
    "rms_error_nm": ("RMS error", "out"),
    "mean_abs_error_nm": ("mean |error|", "out"),
    "mean_abs_duty_step_pct": ("mean input step", "in"),
    "saturated_fraction": ("share at a limit", ""),
}
SCENARIO_NAMES = {
    "steps": "steps", "multisine": "sum of sines", "sweep": "sines of rising frequency",
    "reference": "own reference", "log": "recorded input", "rehab": "rehabilitation",
}  # fmt: skip


def _units(replay: Replay) -> dict[str, str]:
    return {"out": replay.head.output_unit, "in": replay.head.input_unit, "": ""}


def metric(replay: Replay, name: str, key: str) -> float | None:
    """One number of one controller; errors of the whole trace where the file says none."""
    one = replay.records[name]
    known: float | None = getattr(one.metrics, key)
    if known is not None or key not in ("max_abs_error_nm", "mean_abs_error_nm"):
        return known
    error = abs(one.columns["reference_nm"] - one.columns["torque_nm"])
    return float(error.max() if key == "max_abs_error_nm" else error.mean())


def tables_of(replay: Replay) -> list[Table]:
    """Every table of one replay that has rows."""
    return [table for table in (log_table(replay), errors_table([replay]), *further_tables(replay)) if table.rows]


def further_tables(replay: Replay) -> tuple[Table, ...]:
    """What a replay has beside its errors."""
    return (steps_table(replay), tones_table(replay), *rehab_tables(replay), plants_table(replay))


def errors_table(replays: Sequence[Replay]) -> Table:
    """Errors and input of each controller, all scenarios in one table."""
    rows: list[tuple[Cell, ...]] = []
    for one in replays:
        said = SCENARIO_NAMES.get(one.head.scenario, one.head.scenario or "own reference")
        names = one.metrics()
        rows += [(said, controller_name(name), *(metric(one, name, key) for key in METRICS)) for name in names]
    caption = "Errors are reference minus true output; the settling time at the start is left out where the scenario "
    units = _units(replays[0])
    heads = [Column(said, units[kind], 3) for said, kind in METRICS.values()]
    return Table(
        "Errors of each controller", f"{caption}has one.", (Column("replay"), Column("controller"), *heads), tuple(rows)
    )


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
    """How each controller follows over plants drawn from the fit's uncertainty; no rows where none were drawn."""
    rows: list[tuple[Cell, ...]] = []
    units = _units(replay) | {"": "1"}
    for name, m in replay.metrics().items():
        drawn = m.plants.metrics if m.plants else {}
        for key, one in drawn.items():
            said, kind = METRICS.get(key, (key, None))
            said = f"{controller_name(name)}: {said}{f' ({units[kind]})' if kind is not None else ''}"
            rows.append((said, one.low, one.median, one.high, one.worst.value, one.worst.plant))
    caption = f"{replay.head.plants} plants drawn from the fit's uncertainty; the figure's shaded band holds 95 % of "
    heads = columns(
        "number", ("2.5 %", "", 3), ("median", "", 3), ("97.5 %", "", 3), ("worst", "", 3), "its plant",
    )  # fmt: skip
    return Table(f"Over drawn plants: {replay.head.scenario}", f"{caption}them.", heads, tuple(rows))


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
        ("settling, 2 %", "s", 3),
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
    """Of each controller, the robust one first: errors by mode, tests between modes; those with rows."""
    order = sorted(replay.metrics().items(), key=lambda item: item[0] != "rc")
    sessions = [(controller_name(name), m) for name, m in order]
    return [table for table in (_modes(sessions, replay), _tests(sessions)) if table.rows]


Sessions = Iterable[tuple[str, Metrics]]


def _modes(sessions: Sessions, replay: Replay) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for name, m in sessions:
        for mode, part in m.modes.items():
            box = part.abs_position_error_deg
            half = f"{number(box.q1, 3)} … {number(box.q3, 3)}"
            rows.append((name, mode, box.median, half, box.mean, part.mean_abs_torque_error_nm))
    heads = columns(
        "controller", "mode", ("median", "°", 3), "middle half (°)", ("mean", "°", 3),
        ("mean error of the output", replay.head.output_unit, 2),
    )  # fmt: skip
    return Table("Errors by mode", "Absolute position error.", heads, tuple(rows))


def _tests(sessions: Sessions) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for name, m in sessions:
        for test in m.tests:
            chances = (_chance(p) for p in (test.samples.p, test.cycles.p_welch, test.cycles.p_rank))
            rows.append((name, " and ".join(test.modes), *chances, number(test.cycles.least_p_rank, 2)))
    caption = "Probability (p) of such a difference by chance. The paper's test takes every millisecond as a new "
    caption += "observation, which it is not; the other two use one mean per movement, and the last column is the "
    caption += "least p that so few movements can give."
    heads = columns("controller", "modes", "p, all samples (paper)", "p, means, Welch", "p, means, ranks", "least p")
    return Table("Do the modes differ?", caption, heads, tuple(rows))


def _chance(p: float | None) -> str:
    """A probability; below what a double can hold it is said to be so."""
    return "< 1e−300" if p == 0 else number(p, 2)
