"""Tables of replays: errors of each controller, steps and tones, drawn plants, logs, rehabilitation."""

from collections.abc import Mapping, Sequence
from typing import Any

from eaid.report.results import Given, Replay
from eaid.report.style import controller_name
from eaid.report.tables.table import Cell, Column, Name, Table, columns, level, number

METRICS = {
    "max_abs_error_nm": ("largest |error|", "out"),
    "rms_error_nm": ("RMS error", "out"),
    "mean_abs_error_nm": ("mean |error|", "out"),
    "mean_abs_duty_step_pct": ("mean input step", "in"),
    "saturated_fraction": ("share at a limit", ""),
}
SCENARIO_NAMES = {
    "steps": "steps", "multisine": "sum of sines", "sweep": "sines of rising frequency", "reference": "own reference",
    "log": "recorded input", "rehab": "rehabilitation",
}  # fmt: skip


def _heads(replay: Replay) -> list[Column]:
    units = {"out": replay.output_unit, "in": replay.input_unit, "": ""}
    return [Column(said, units[kind], 3) for said, kind in METRICS.values()]


def metric(replay: Replay, name: str, key: str) -> float | None:
    """One number of one controller; errors of the whole trace where the file says none."""
    known = (replay.summary.get(name) or {}).get(key)
    if isinstance(known, int | float):
        return float(known)
    trace = replay.traces[name]
    error = abs(trace["reference_nm"] - trace["torque_nm"])
    return {"max_abs_error_nm": float(error.max()), "mean_abs_error_nm": float(error.mean())}.get(key)


def replays_table(replays: Sequence[Given[Replay]]) -> Table:
    """Errors and input of each controller, all scenarios in one table."""
    rows: list[tuple[Cell, ...]] = []
    for one in replays:
        said = SCENARIO_NAMES.get(one.result.scenario, one.result.scenario or "own reference")
        rows += [
            (said, controller_name(name), *(metric(one.result, name, key) for key in METRICS))
            for name in one.result.traces
        ]
    caption = "Errors are reference minus true output; the settling time at the start is left out where the scenario "
    heads = (Column("replay"), Column("controller"), *_heads(replays[0].result))
    return Table("Errors of each controller", f"{caption}has one.", heads, tuple(rows))


def log_table(replay: Replay) -> Table:
    """How far the model is from each recorded run when it gets the recorded input."""
    rows: list[tuple[Cell, ...]] = []
    for name, known in replay.summary.items():
        if known.get("reference_is") != "recorded torque":
            continue
        R2 = known.get("R2", known.get("explained_variance"))
        rows.append(
            (
                Name(name), known.get("rms_difference_nm"), known.get("max_abs_difference_nm"),
                known.get("mean_difference_nm"), None if R2 is None else 100 * R2,
            )
        )  # fmt: skip
    out = replay.output_unit
    heads = columns(
        "run", ("RMS difference", out, 3), ("largest", out, 3), ("mean, recorded − model", out, 3), ("R²", "%", 4)
    )  # fmt: skip
    return Table("Recorded input through the model", "Each log's own input drives the model.", heads, tuple(rows))


def plants_table(replay: Replay) -> Table:
    """Spread of the numbers over plants drawn from the fit's uncertainty; no rows where none were drawn."""
    rows: list[tuple[Cell, ...]] = []
    units = {"out": replay.output_unit, "in": replay.input_unit, "": "1"}
    for name, known in replay.summary.items():
        drawn = (known.get("plants") or {}).get("metrics") or {}
        for key, (said, kind) in METRICS.items():
            if one := drawn.get(key):
                worst = (one.get("worst") or {}).get("value")
                cells = (one.get("p2.5"), one.get("median"), one.get("p97.5"), worst)
                rows.append((f"{controller_name(name)}: {said} ({units[kind]})", *cells))
    caption = f"{replay.options.get('plants')} plants drawn from the fit's uncertainty; the figure's shaded band holds "
    heads = columns("number", ("2.5 %", "", 3), ("median", "", 3), ("97.5 %", "", 3), ("worst", "", 3))
    return Table(f"Over drawn plants: {replay.scenario}", f"{caption}95 % of them.", heads, tuple(rows))


def steps_table(replay: Replay) -> Table:
    """Rise, overshoot and settling of each step."""
    rows: list[tuple[Cell, ...]] = []
    for name in replay.traces:
        for step in (replay.summary.get(name) or {}).get("steps") or []:
            change = f"{level(step.get('from_nm'))} → {level(step.get('to_nm'))}"
            cells = (step.get(key) for key in ("rise_time_s", "overshoot_pct", "settling_s"))
            rows.append((controller_name(name), change, *cells))
    caption = "Rise from 10 to 90 %; settling to within 2 % of the step; a dash where the next step comes first."
    heads = columns(
        "controller", ("step", replay.output_unit), ("rise time", "s", 3), ("overshoot", "%", 3),
        ("settling time", "s", 3),
    )  # fmt: skip
    return Table("Each step", caption, heads, tuple(rows))


def tones_table(replay: Replay) -> Table:
    """Amplitude and phase of each tone of a sweep."""
    keys = ("frequency_hz", "gain_db", "phase_deg", "mean_abs_error_nm")
    rows = tuple(
        (controller_name(name), *(row.get(key) for key in keys))
        for name in replay.traces
        for row in (replay.summary.get(name) or {}).get("frequencies") or []
    )
    caption = "Amplitude and phase of the output against the reference, at the sine's own frequency."
    heads = columns(
        "controller", ("frequency", "Hz", 3), ("amplitude", "dB", 3), ("phase", "°", 3),
        ("mean |error|", replay.output_unit, 3),
    )  # fmt: skip
    return Table("Each frequency", caption, heads, rows)


def rehab_tables(replay: Replay) -> list[Table]:
    """Errors by mode, tests between modes, normality."""
    order = sorted(replay.summary, key=lambda name: name != "rc")
    numbers: Mapping[str, Any] = next(
        (replay.summary[name] for name in order if (replay.summary[name] or {}).get("modes")), {}
    )
    numbers = numbers.get("rehab") or numbers
    found = []
    rows: list[tuple[Cell, ...]] = []
    for mode, part in (numbers.get("modes") or {}).items():
        box = part.get("abs_position_error_deg") or {}
        half = f"{number(box.get('q1'), 3)} … {number(box.get('q3'), 3)}"
        error = part.get("mean_abs_torque_error_nm")
        rows.append((mode, box.get("median"), half, box.get("mean"), error, number(box.get("independent"), 2)))
    if rows:
        heads = columns(
            "mode", ("median", "°", 3), "middle half (°)", ("mean", "°", 3),
            ("mean torque error", replay.output_unit, 2), "independent observations",
        )  # fmt: skip
        caption = "Absolute position error; the last column says how many independent observations the samples are "
        found.append(Table("Errors by mode", f"{caption}worth.", heads, tuple(rows)))
    tests: list[tuple[Cell, ...]] = []
    for test in numbers.get("tests") or []:
        samples, cycles = test.get("samples") or {}, test.get("cycles") or {}
        pair = " and ".join(str(mode) for mode in test.get("modes") or [])
        chances = (_chance(p) for p in (samples.get("p"), cycles.get("p_welch"), cycles.get("p_rank")))
        tests.append((pair, *chances, number(cycles.get("least_p_rank"), 2)))
    if tests:
        caption = "Probability (p) of such a difference by chance. The paper's test takes every millisecond as a new "
        caption += "observation, which it is not; the other two use one mean per movement, and the last column is the "
        caption += "least p that so few movements can give."
        heads = columns("modes", "p, all samples (paper)", "p, means, Welch", "p, means, ranks", "least p of ranks")
        found.append(Table("Do the modes differ?", caption, heads, tuple(tests)))
    normal = tuple(
        (mode, _chance(part.get("p")), "not normal" if part.get("rejected") else "may be normal")
        for mode, part in (numbers.get("normality") or {}).items()
    )
    if normal:
        caption = "A small p rejects normality; the paper reads its p < 0.001 the other way round."
        found.append(Table("Are the errors normal?", caption, columns("mode", "p", "verdict"), normal))
    return found


def _chance(p: Any) -> str:
    """A probability; below what a double can hold it is said to be so."""
    return "< 1e−300" if p == 0 else number(p, 2)
