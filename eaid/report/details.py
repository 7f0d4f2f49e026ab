"""Tables behind the figures: runs, levels, guarantee, margins, replays, rehabilitation."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from eaid.report import tables
from eaid.report.results import Data, Fit, Replay
from eaid.report.style import controller_name
from eaid.report.tables import Table, number


def details(fit: Fit, called: str) -> list[Table]:
    """All tables of one fit: single levels, input gain, release, held-out levels, which shape and degree."""
    found = []
    content = fit.content
    if (content.get("friction") or {}).get("levels"):
        found.append(tables.levels_table(content))
    if (content.get("linear") or {}).get("per_level"):
        found.append(tables.input_gain_table(content))
    if isinstance(release := content.get("release"), Mapping) and release.get("levels"):
        found.append(release_table(release))
    if held := held_out(content):
        found.append(held)
    found += adequacy(content)
    return [replace(table, heading=f"{table.heading}: {called}") for table in found]


def release_table(part: Mapping[str, Any]) -> Table:
    """Time constants of the falling edges, pooled and of each level."""
    rows = [
        (
            "all together",
            number(part.get("tau1")),
            number(part.get("tau2")),
            "–",
            "–",
            number(part.get("rmse"), 3),
        )
    ]
    rows += [
        (
            f"{tables.level(row.get('level'))} %",
            number(row.get("tau1")),
            number(row.get("tau2")),
            number(row.get("amplitude")),
            number(row.get("residual"), 3),
            number(row.get("rmse"), 3),
        )
        for row in part.get("levels") or []
    ]
    return Table(
        "Release",
        "How torque falls after the duty returns to zero; the replays use the pooled constants.",
        ("level", "τ1 (s)", "τ2 (s)", "falls by (N·m)", "is left (N·m)", "RMSE (N·m)"),
        tuple(rows),
    )


def held_out(content: Mapping[str, Any]) -> Table | None:
    """Errors on levels that were not fitted; None where none was held out."""
    rows = []
    for name in ("friction", "nonlinear", "linear"):
        part = (content.get(name) or {}).get("hold_out")
        if isinstance(part, Mapping):
            for row in part.get("levels") or []:
                error = row.get("abs_error") or {}
                rows.append(
                    (
                        name,
                        tables.level(row.get("level")),
                        number(row.get("rmse"), 3),
                        number(error.get("mean"), 3),
                        number(part.get("fitted_rmse"), 3),
                    )
                )
    if not rows:
        return None
    return Table(
        "Levels held out",
        "Levels that the fit never saw, predicted by the model from the others.",
        ("model", "level", "RMSE (N·m)", "mean |error| (N·m)", "RMSE on the fitted levels"),
        tuple(rows),
    )


def runs(data: Data) -> Table:
    """One row per recorded step of a dataset, with what is doubtful in it."""
    rows = [
        (
            run.name,
            tables.level(run.level),
            str(run.repeat),
            run.edge,
            str(run.samples),
            number(run.rate_hz, 4),
            number(run.baseline_nm, 3),
            "; ".join(run.warnings) or "nothing",
        )
        for run in data.steps.runs
    ]
    unit = data.steps.input_unit
    return Table(
        f"Runs of {data.source.path}",
        "One row per recorded step. The idle torque is the mean before the step; it is subtracted before fitting.",
        (
            "run",
            f"level ({unit})" if unit else "level",
            "repeat",
            "edge",
            "samples",
            "rate (Hz)",
            f"idle ({data.steps.output_unit})",
            "doubtful",
        ),
        tuple(rows),
        formulas=False,
    )


def guarantee(gains: Mapping[str, Any]) -> list[Table]:
    """The terms of inequality (15) and whether each bound in it is a true one."""
    rc = gains.get("rc") or {}
    rho = rc.get("rho") or {}
    needed = rho.get("needed") or {}
    bound = rc.get("ultimate_bound") or {}
    rows = [
        ("α by Eq. (16), and reached with this B̂", f"{number(rc.get('alpha'))}, {number(rc.get('alpha_reached'))}"),
        ("ρ as it is", f"{number(rho.get('constant'))} + {number(rho.get('slope'))} ‖ξ‖ N·m/s"),
        (
            "ρ that the α reached asks for",
            f"{number(needed.get('constant'))} + {number(needed.get('slope'))} ‖ξ‖ N·m/s",
        ),
        ("so inequality (15) holds", _plain(rc.get("guaranteed"))),
        ("φ as entered means a duty of", f"{number(rc.get('phi_honest_pct'))} %"),
        ("the data ask for a duty of", f"{number(rc.get('phi_needed_pct'))} %"),
        ("so φ is a true bound on this plant", _plain(rc.get("phi_holds"))),
        ("Q_M is a true bound on the reference", _plain(rc.get("Q_M_holds"))),
        ("torque error that the theory bounds in the end", f"{number(bound.get('torque_error_nm'))} N·m"),
        ("largest torque error in the replayed sum of sines", f"{number(bound.get('replayed_nm'))} N·m"),
    ]
    shown = tuple(row for row in rows if row[1].split()[0].rstrip(",") != "–")
    if not shown:
        return []
    return [
        Table(
            "The guarantee's terms",
            "Inequality (15): ρ ≥ (α Q_M + α ‖K‖ ‖ξ‖ + B_M φ)/(1 − α). It needs α, φ and Q_M to be true bounds.",
            ("term", "value"),
            shown,
        )
    ]


def margins(gains: Mapping[str, Any]) -> list[Table]:
    """Gain, phase and delay margins of both controllers around held duties."""
    found = gains.get("margins") or {}
    rows = []
    for point in found.get("points") or []:
        cells = [tables.level(point.get("duty_pct")), number(point.get("torque_nm"), 3)]
        for name in ("rc", "pi"):
            one = point.get(name) or {}
            delay = one.get("delay_s")
            cells += [
                number(one.get("gain_db"), 3),
                number(one.get("phase_deg"), 3),
                number(1e3 * delay, 3) if isinstance(delay, int | float) else "–",
            ]
        rows.append(tuple(cells))
    if not rows:
        return []
    return [
        Table(
            "Margins",
            "How much the loop's gain may grow, its phase may lag, and its delay may grow before it becomes "
            "unstable, around a held duty.",
            (
                "duty (%)",
                "torque (N·m)",
                "RC: gain (dB)",
                "phase (°)",
                "delay (ms)",
                "PI: gain (dB)",
                "phase (°)",
                "delay (ms)",
            ),
            tuple(rows),
        )
    ]


def adequacy(content: Mapping[str, Any]) -> list[Table]:
    """Which curve suits a level, and which degree suits each polynomial."""
    judged = (content.get("uncertainty") or {}).get("adequacy") or {}
    found = []
    if shapes := judged.get("shapes"):
        rows = tuple(
            (
                str(row.get("name")),
                number(row.get("parameters"), 1),
                number(row.get("rmse"), 3),
                number(row.get("aicc"), 6),
            )
            for row in shapes
        )
        found.append(
            Table(
                "Which shape",
                "Curves tried on each level. AICc weighs closeness against the number of values fitted: the "
                "least is best, differences below about 4 say little.",
                ("curve", "values a level", "RMSE (N·m)", "AICc"),
                rows,
            )
        )
    if orders := judged.get("orders"):
        degrees = tuple(
            (
                tables.SYMBOLS.get(str(row.get("parameter")), str(row.get("parameter"))),
                number(row.get("order"), 1),
                number(row.get("chi_square"), 4),
                number(row.get("aicc"), 4),
                number(row.get("leave_one_out_pct"), 3),
            )
            for row in orders
        )
        found.append(
            Table(
                "Which degree",
                "Polynomials of the duty tried for each value. The last column is the typical error when a "
                "level is left out and predicted from the others.",
                ("value", "degree", "χ²", "AICc", "left-out error (%)"),
                degrees,
            )
        )
    return found


def _plain(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "–" if value is None else str(value)


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
