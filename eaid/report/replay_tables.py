"""Tables of replays: errors of each controller, steps and tones, drawn plants, logs, rehabilitation."""

from collections.abc import Mapping
from typing import Any

from eaid.report import tables
from eaid.report.results import Replay
from eaid.report.style import controller_name
from eaid.report.tables import Table, number

METRICS = {
    "max_abs_error_nm": "largest |error| (N·m)",
    "rms_error_nm": "RMS error (N·m)",
    "mean_abs_error_nm": "mean |error| (N·m)",
    "mean_abs_duty_step_pct": "mean duty step (%)",
    "saturated_fraction": "share at a limit",
}


def replay_table(replay: Replay) -> Table:
    """Errors and duty of each controller in one replay."""
    rows = []
    for name, trace in replay.traces.items():
        known = replay.summary.get(name) or {}
        error = abs(trace["reference_nm"] - trace["torque_nm"])
        known = {"max_abs_error_nm": float(error.max()), "mean_abs_error_nm": float(error.mean()), **known}
        rows.append((controller_name(name), *(number(known.get(key), 3) for key in METRICS)))
    if replay.scenario == "multisine" and {"rc", "pi"} <= set(replay.traces):
        rc, pi = ((replay.summary.get(name) or {}).get("max_abs_error_nm") for name in ("rc", "pi"))
        if rc is not None and pi:
            rows.append(("RC against PI", f"{number(100 * (1 - rc / pi), 2)} % less", "", "", "", ""))
    return Table(
        f"Replay: {replay.scenario or 'reference of your own'}",
        f"From {replay.source.path}; errors are reference minus true torque, the settling time at the start "
        "left out where the scenario has one.",
        ("controller", *METRICS.values()),
        tuple(rows),
    )


def log_table(replay: Replay) -> Table:
    """How far the model is from each recorded run when it gets the recorded duty."""
    rows = [
        (
            name,
            number(known.get("rms_difference_nm"), 3),
            number(known.get("max_abs_difference_nm"), 3),
            number(known.get("mean_difference_nm"), 3),
            number(100 * known["explained_variance"], 4) if known.get("explained_variance") is not None else "–",
        )
        for name, known in replay.summary.items()
        if known.get("reference_is") == "recorded torque"
    ]
    return Table(
        "Recorded duty through the model",
        f"From {replay.source.path}: each log's own duty drives the fitted model.",
        ("run", "RMS difference (N·m)", "largest (N·m)", "mean, recorded − model (N·m)", "variance explained (%)"),
        tuple(rows),
        formulas=False,
    )


def plants_table(replay: Replay) -> list[Table]:
    """Spread of the numbers over plants drawn from the fit's uncertainty; empty where none were drawn."""
    rows = []
    for name, known in replay.summary.items():
        drawn = (known.get("plants") or {}).get("metrics") or {}
        for key, said in METRICS.items():
            if one := drawn.get(key):
                worst = (one.get("worst") or {}).get("value")
                cells = (number(value, 3) for value in (one.get("p2.5"), one.get("median"), one.get("p97.5"), worst))
                rows.append((f"{controller_name(name)}: {said}", *cells))
    if not rows:
        return []
    count = replay.options.get("plants")
    return [
        Table(
            f"Over drawn plants: {replay.scenario}",
            f"{count} plants drawn from the fit's uncertainty; the figure's shaded band holds 95 % of them.",
            ("number", "2.5 %", "median", "97.5 %", "worst"),
            tuple(rows),
        )
    ]


def step_tables(replay: Replay) -> list[Table]:
    """Rise, overshoot and settling of each step; amplitude and phase of each tone."""
    found = []
    rows = []
    for name in replay.traces:
        for step in (replay.summary.get(name) or {}).get("steps") or []:
            change = f"{tables.level(step.get('from_nm'))} → {tables.level(step.get('to_nm'))}"
            rows.append(
                (
                    controller_name(name),
                    change,
                    *(number(step.get(key), 3) for key in ("rise_time_s", "overshoot_pct", "settling_s")),
                )
            )
    if rows:
        found.append(
            Table(
                "Each step",
                "Rise from 10 to 90 %; settling to within 2 % of the step; a dash where it is not reached "
                "before the next step.",
                ("controller", "step (N·m)", "rise time (s)", "overshoot (%)", "settling time (s)"),
                tuple(rows),
            )
        )
    tones = [
        (
            controller_name(name),
            *(number(row.get(key), 3) for key in ("frequency_hz", "gain_db", "phase_deg", "mean_abs_error_nm")),
        )
        for name in replay.traces
        for row in (replay.summary.get(name) or {}).get("frequencies") or []
    ]
    if tones:
        found.append(
            Table(
                "Each frequency",
                "Amplitude and phase of the torque against the reference, at the sine's own frequency.",
                ("controller", "frequency (Hz)", "amplitude (dB)", "phase (°)", "mean |error| (N·m)"),
                tuple(tones),
            )
        )
    return found


def rehab_tables(replay: Replay) -> list[Table]:
    """Errors by mode, tests between modes, normality."""
    order = sorted(replay.summary, key=lambda name: name != "rc")
    numbers: Mapping[str, Any] = next(
        (replay.summary[name] for name in order if (replay.summary[name] or {}).get("modes")), {}
    )
    numbers = numbers.get("rehab") or numbers
    found = []
    rows = []
    for mode, part in (numbers.get("modes") or {}).items():
        box = part.get("abs_position_error_deg") or {}
        rows.append(
            (
                mode,
                number(box.get("median"), 3),
                f"{number(box.get('q1'), 3)} … {number(box.get('q3'), 3)}",
                number(box.get("mean"), 3),
                number(part.get("mean_abs_torque_error_nm"), 2),
                number(box.get("independent"), 2),
            )
        )
    if rows:
        found.append(
            Table(
                "Errors by mode",
                "Absolute position error in degrees; the last column says how many independent observations "
                "the samples are worth.",
                (
                    "mode",
                    "median (°)",
                    "middle half (°)",
                    "mean (°)",
                    "mean torque error (N·m)",
                    "independent observations",
                ),
                tuple(rows),
            )
        )
    tests = []
    for test in numbers.get("tests") or []:
        samples, cycles = test.get("samples") or {}, test.get("cycles") or {}
        pair = " and ".join(str(mode) for mode in test.get("modes") or [])
        tests.append(
            (
                pair,
                *(_chance(p) for p in (samples.get("p"), cycles.get("p_welch"), cycles.get("p_rank"))),
                number(cycles.get("least_p_rank"), 2),
            )
        )
    if tests:
        found.append(
            Table(
                "Do the modes differ?",
                "Probability (p) of such a difference by chance. The paper's test takes every millisecond as "
                "a new observation, which it is not; "
                "the other two use one mean per movement, and the last column is the least p that so few "
                "movements can give.",
                ("modes", "p, all samples (paper)", "p, means, Welch", "p, means, ranks", "least p of ranks"),
                tuple(tests),
            )
        )
    normal = [
        (mode, _chance(part.get("p")), "not normal" if part.get("rejected") else "may be normal")
        for mode, part in (numbers.get("normality") or {}).items()
    ]
    if normal:
        found.append(
            Table(
                "Are the errors normal?",
                "A small p rejects normality; the paper reads its p < 0.001 the other way round.",
                ("mode", "p", "verdict"),
                tuple(normal),
            )
        )
    return found


def _chance(p: Any) -> str:
    """A probability; below what a double can hold it is said to be so."""
    return "< 1e−300" if p == 0 else number(p, 2)
