"""What stands where on the page: sections with their tables, the files, the commands, the words."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from eaid.report import tables
from eaid.report.catalogue import two_alike
from eaid.report.results import Data, Fit, Replay, Results
from eaid.report.style import controller_name
from eaid.report.tables import Table, interval, number

KINDS = {
    "clutch": ("clutch", "%"),
    "friction-force": ("friction over force", "N"),
    "friction-speed": ("friction over speed", "RPM"),
}


@dataclass(frozen=True)
class Section:
    """A section: its figures stand between the tables of `first` and those of `tables`."""

    id: str
    title: str
    lead: str
    first: tuple[Table, ...]
    tables: tuple[Table, ...]


def title(results: Results, synthetic: str | None) -> str:
    """What the page is about; synthetic data say so."""
    if two_alike(results):
        text = "Electroadhesive clutch: two fits side by side"
    elif results.fits:
        kinds = list(dict.fromkeys(KINDS.get(fit.kind, (fit.kind, ""))[0] for fit in results.fits))
        text = f"Electroadhesive clutch: report on {', '.join(kinds)}"
    elif results.replays:
        text = "Electroadhesive clutch: replays"
    else:
        text = "Electroadhesive clutch: report"
    return f"{text} (synthetic data)" if synthetic else text


def inputs(results: Results) -> Table:
    """The files given to the report and, for each fit, the files behind it."""
    rows: list[tuple[str, ...]] = []
    for source in results.sources:
        rows.append((source.path, source.kind, _what(results, source.path), source.sha256))
    given = {source.sha256 for source in results.sources}
    for fit in results.fits:
        data = fit.content.get("data") or {}
        named = [item for item in data.get("inputs") or [] if isinstance(item, Mapping)]
        behind = named or [item for item in data.get("sources") or [] if isinstance(item, Mapping)]
        runs: dict[tuple[str, str], Counter[Any]] = {}
        for item in behind:
            runs.setdefault((str(item.get("path", "?")), str(item.get("sha256", "–"))), Counter())[item.get("level")] += 1
        for (path, sha), counts in runs.items():
            if sha not in given:
                rows.append((path, f"log behind {fit.source.path}", "–" if named else _levels(counts), sha))
    return Table(
        "Files", "What was given to this report, and the logs that the fits name. The fingerprint (SHA-256) tells one version of a file from another.",
        ("file", "what it is", "holds", "fingerprint"), tuple(rows), formulas=False,
    )  # fmt: skip


def _levels(counts: Counter[Any]) -> str:
    if not counts:
        return "–"
    least, most = min(counts.values()), max(counts.values())
    runs = f"{least}" if least == most else f"{least} to {most}"
    return f"{len(counts)} level{'s' if len(counts) != 1 else ''}, {runs} run{'s' if most != 1 else ''} each"


def _what(results: Results, path: str) -> str:
    for fit in results.fits:
        if fit.source.path == path:
            data = fit.content.get("data") or {}
            models = [name for name in ("friction", "nonlinear", "linear", "release") if fit.content.get(name)]
            text = f"{KINDS.get(fit.kind, (fit.kind, ''))[0]}: {', '.join(models) or 'no model'}"
            counts = Counter(item.get("level") for item in data.get("sources") or [] if isinstance(item, Mapping) and item.get("edge") != "falling")
            return f"{text}; {_levels(counts)}" if counts else text
    for data in results.data:
        if data.source.path == path:
            counts = Counter(level.level for level in data.steps.levels for _ in level.names)
            return f"{KINDS.get(data.steps.kind, (data.steps.kind, ''))[0]}: {_levels(counts)}"
    for replay in results.replays:
        if replay.source.path == path:
            return f"{replay.scenario or 'replay'}: {', '.join(controller_name(name) for name in replay.traces)}"
    return "robust and PI gains"


def sections(results: Results) -> list[Section]:
    """The sections that have anything to show, in the order of the page."""
    found = []
    if results.data or results.fit("clutch"):
        found.append(
            Section("data", "Data", "What was recorded: each run, its repeats, and what is doubtful in it.", (), tuple(_runs(data) for data in results.data))
        )
    if results.fits:
        found.append(
            Section(
                "models", "Models",
                "What was fitted to the data, with 95 % intervals where the fit gives them, beside the published values.",
                _published_tables(results), tuple(t for fit in results.fits for t in _details(fit)),
            )
        )  # fmt: skip
    pair = two_alike(results)
    if pair:
        found.append(Section("compare", "Side by side", "The same values of both fits; a difference beyond both intervals is more than repeats explain.", (compare(*pair),), ()))
    if results.gains or (results.fit("clutch") and (results.fit("clutch") or results.fits[0]).content.get("linear")):
        gains = [t for one in results.gains for t in (tables.table_iv(one.content), tables.gains_table(one.content), *_guarantee(one.content), *_margins(one.content))]
        found.append(Section("gains", "Gains", "What the two controllers use, and whether the robust one's stability condition, inequality (15), holds.", tuple(gains), ()))
    if replays := [replay for replay in results.replays if replay.scenario != "rehab"]:
        found.append(
            Section("replays", "Replays", "Controllers tried on the fitted plant: no rig was moved.", tuple(_replay_table(replay) for replay in replays), tuple(t for replay in replays for t in _step_tables(replay)))
        )
    if (rehab := results.replay("rehab")) is not None:
        found.append(
            Section(
                "rehab", "Rehabilitation",
                "A simulated elbow in three exercises on the fitted clutch: resisted softly, resisted hard, and moved by the device.",
                (), tuple(_rehab_tables(rehab)),
            )
        )  # fmt: skip
    return found


def _published_tables(results: Results) -> tuple[Table, ...]:
    found = []
    if (fit := results.fit("friction-force")) and fit.content.get("friction"):
        found.append(tables.table_i(fit.content))
    if (fit := results.fit("friction-speed")) and fit.content.get("friction"):
        found.append(tables.table_ii(fit.content))
    if (fit := results.fit("clutch")) and fit.content.get("nonlinear"):
        found.append(tables.table_iii(fit.content))
    if (fit := results.fit("clutch")) and fit.content.get("linear"):
        found.append(tables.linear_table(fit.content))
    return tuple(found)


def _details(fit: Fit) -> list[Table]:
    found = []
    content = fit.content
    if (content.get("friction") or {}).get("levels"):
        one = tables.levels_table(content)
        kind = KINDS.get(fit.kind, (fit.kind, ""))[0]
        found.append(Table(f"{one.heading}: {kind}", one.caption, one.columns, one.rows))
    if (content.get("linear") or {}).get("per_level"):
        found.append(tables.input_gain_table(content))
    if isinstance(release := content.get("release"), Mapping) and release.get("levels"):
        found.append(_release(release))
    if held := _held_out(content):
        found.append(held)
    found += _adequacy(content)
    return found


def _release(release: Mapping[str, Any]) -> Table:
    rows = [("all together", number(release.get("tau1")), number(release.get("tau2")), "–", "–", number(release.get("rmse"), 3))]
    for row in release.get("levels") or []:
        rows.append(
            (f"{tables.level(row.get('level'))} %", number(row.get("tau1")), number(row.get("tau2")), number(row.get("amplitude")), number(row.get("residual"), 3), number(row.get("rmse"), 3))
        )
    return Table(
        "Release", "How torque falls after the duty returns to zero; the replays use the pooled constants.",
        ("level", "τ1 (s)", "τ2 (s)", "falls by (N·m)", "is left (N·m)", "RMSE (N·m)"), tuple(rows),
    )  # fmt: skip


def _held_out(content: Mapping[str, Any]) -> Table | None:
    rows = []
    for name in ("friction", "nonlinear", "linear"):
        part = (content.get(name) or {}).get("hold_out")
        if isinstance(part, Mapping):
            for row in part.get("levels") or []:
                error = row.get("abs_error") or {}
                rows.append((name, tables.level(row.get("level")), number(row.get("rmse"), 3), number(error.get("mean"), 3), number(part.get("fitted_rmse"), 3)))
    if not rows:
        return None
    return Table(
        "Levels held out", "Levels that the fit never saw, predicted by the model from the others.",
        ("model", "level", "RMSE (N·m)", "mean |error| (N·m)", "RMSE on the fitted levels"), tuple(rows),
    )  # fmt: skip


def _runs(data: Data) -> Table:
    rows = []
    for run in data.steps.runs:
        rows.append(
            (run.name, tables.level(run.level), str(run.repeat), run.edge, str(run.samples), number(run.rate_hz, 4), number(run.baseline_nm, 3), "; ".join(run.warnings) or "nothing")
        )
    unit = data.steps.input_unit
    return Table(
        f"Runs of {data.source.path}", "One row per recorded step. The idle torque is the mean before the step; it is subtracted before fitting.",
        ("run", f"level ({unit})" if unit else "level", "repeat", "edge", "samples", "rate (Hz)", f"idle ({data.steps.output_unit})", "doubtful"), tuple(rows), formulas=False,
    )  # fmt: skip


def _guarantee(gains: Mapping[str, Any]) -> list[Table]:
    rc = gains.get("rc") or {}
    rho = rc.get("rho") or {}
    needed = rho.get("needed") or {}
    bound = rc.get("ultimate_bound") or {}
    rows = [
        ("α by Eq. (16), and reached with this B̂", f"{number(rc.get('alpha'))}, {number(rc.get('alpha_reached'))}"),
        ("ρ as it is", f"{number(rho.get('constant'))} + {number(rho.get('slope'))} ‖ξ‖ N·m/s"),
        ("ρ that the α reached asks for", f"{number(needed.get('constant'))} + {number(needed.get('slope'))} ‖ξ‖ N·m/s"),
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
            "The guarantee's terms", "Inequality (15): ρ ≥ (α Q_M + α ‖K‖ ‖ξ‖ + B_M φ)/(1 − α). It needs α, φ and Q_M to be true bounds.",
            ("term", "value"), shown,
        )
    ]  # fmt: skip


def _margins(gains: Mapping[str, Any]) -> list[Table]:
    margins = gains.get("margins") or {}
    rows = []
    for point in margins.get("points") or []:
        cells = [tables.level(point.get("duty_pct")), number(point.get("torque_nm"), 3)]
        for name in ("rc", "pi"):
            one = point.get(name) or {}
            delay = one.get("delay_s")
            cells += [number(one.get("gain_db"), 3), number(one.get("phase_deg"), 3), number(1e3 * delay, 3) if isinstance(delay, int | float) else "–"]
        rows.append(tuple(cells))
    if not rows:
        return []
    return [
        Table(
            "Margins", "How much the loop's gain may grow, its phase may lag, and its delay may grow before it becomes unstable, around a held duty.",
            ("duty (%)", "torque (N·m)", "RC: gain (dB)", "phase (°)", "delay (ms)", "PI: gain (dB)", "phase (°)", "delay (ms)"), tuple(rows),
        )
    ]  # fmt: skip


def _adequacy(content: Mapping[str, Any]) -> list[Table]:
    adequacy = (content.get("uncertainty") or {}).get("adequacy") or {}
    found = []
    if shapes := adequacy.get("shapes"):
        rows = tuple((str(row.get("name")), number(row.get("parameters"), 1), number(row.get("rmse"), 3), number(row.get("aicc"), 6)) for row in shapes)
        found.append(Table("Which shape?", "Curves tried on each level. AICc weighs closeness against the number of values fitted: the least is best, differences below about 4 say little.", ("curve", "values a level", "RMSE (N·m)", "AICc"), rows))
    if orders := adequacy.get("orders"):
        rows = tuple(
            (tables.SYMBOLS.get(str(row.get("parameter")), str(row.get("parameter"))), number(row.get("order"), 1), number(row.get("chi_square"), 4), number(row.get("aicc"), 4), number(row.get("leave_one_out_pct"), 3))
            for row in orders
        )
        found.append(
            Table(
                "Which degree?", "Polynomials of the duty tried for each value. The last column is the typical error when a level is left out and predicted from the others.",
                ("value", "degree", "χ²", "AICc", "left-out error (%)"), rows,
            )
        )  # fmt: skip
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


def _replay_table(replay: Replay) -> Table:
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
        f"Replay: {replay.scenario or 'reference of your own'}", f"From {replay.source.path}; errors are reference minus true torque, the settling time at the start left out where the scenario has one.",
        ("controller", *METRICS.values()), tuple(rows),
    )  # fmt: skip


def _step_tables(replay: Replay) -> list[Table]:
    found = []
    rows = []
    for name in replay.traces:
        for step in (replay.summary.get(name) or {}).get("steps") or []:
            change = f"{tables.level(step.get('from_nm'))} → {tables.level(step.get('to_nm'))}"
            rows.append((controller_name(name), change, *(number(step.get(key), 3) for key in ("rise_time_s", "overshoot_pct", "settling_s"))))
    if rows:
        found.append(
            Table(
                "Each step", "Rise from 10 to 90 %; settling to within 2 % of the step; a dash where it is not reached before the next step.",
                ("controller", "step (N·m)", "rise time (s)", "overshoot (%)", "settling time (s)"), tuple(rows),
            )
        )  # fmt: skip
    tones = [
        (controller_name(name), *(number(row.get(key), 3) for key in ("frequency_hz", "gain_db", "phase_deg", "mean_abs_error_nm")))
        for name in replay.traces
        for row in (replay.summary.get(name) or {}).get("frequencies") or []
    ]
    if tones:
        found.append(
            Table(
                "Each frequency", "Amplitude and phase of the torque against the reference, at the sine's own frequency.",
                ("controller", "frequency (Hz)", "amplitude (dB)", "phase (°)", "mean |error| (N·m)"), tuple(tones),
            )
        )  # fmt: skip
    return found


def _rehab_tables(replay: Replay) -> list[Table]:
    order = sorted(replay.summary, key=lambda name: name != "rc")
    numbers: Mapping[str, Any] = next((replay.summary[name] for name in order if (replay.summary[name] or {}).get("modes")), {})
    numbers = numbers.get("rehab") or numbers
    found = []
    rows = []
    for mode, part in (numbers.get("modes") or {}).items():
        box = part.get("abs_position_error_deg") or {}
        rows.append(
            (mode, number(box.get("median"), 3), f"{number(box.get('q1'), 3)} … {number(box.get('q3'), 3)}", number(box.get("mean"), 3), number(part.get("mean_abs_torque_error_nm"), 2), number(box.get("independent"), 2))
        )
    if rows:
        found.append(
            Table(
                "Errors by mode", "Absolute position error in degrees; the last column says how many independent observations the samples are worth.",
                ("mode", "median (°)", "middle half (°)", "mean (°)", "mean torque error (N·m)", "independent observations"), tuple(rows),
            )
        )  # fmt: skip
    tests = []
    for test in numbers.get("tests") or []:
        samples, cycles = test.get("samples") or {}, test.get("cycles") or {}
        pair = " and ".join(str(mode) for mode in test.get("modes") or [])
        tests.append((pair, *(_chance(p) for p in (samples.get("p"), cycles.get("p_welch"), cycles.get("p_rank"))), number(cycles.get("least_p_rank"), 2)))
    if tests:
        found.append(
            Table(
                "Do the modes differ?",
                "Probability (p) of such a difference by chance. The paper's test takes every millisecond as a new observation, which it is not; "
                "the other two use one mean per movement, and the last column is the least p that so few movements can give.",
                ("modes", "p, all samples (paper)", "p, means, Welch", "p, means, ranks", "least p of ranks"), tuple(tests),
            )
        )  # fmt: skip
    normal = [(mode, _chance(part.get("p")), "not normal" if part.get("rejected") else "may be normal") for mode, part in (numbers.get("normality") or {}).items()]
    if normal:
        found.append(
            Table(
                "Are the errors normal?", "A small p rejects normality; the paper reads its p < 0.001 the other way round.",
                ("mode", "p", "verdict"), tuple(normal),
            )
        )  # fmt: skip
    return found


def _chance(p: Any) -> str:
    """A probability; below what a double can hold it is said to be so."""
    return "< 1e−300" if p == 0 else number(p, 2)


def compare(first: Fit, second: Fit) -> Table:
    """Values of two fits of one kind: both, their difference, and whether the intervals touch."""
    rows: list[tuple[str, ...]] = []

    def add(name: str, unit: str, a: Any, b: Any, ends_a: Any = None, ends_b: Any = None) -> None:
        if not isinstance(a, int | float) or not isinstance(b, int | float):
            return
        change = f"{100 * (b / a - 1):+.1f} %".replace("-", "−") if a else "–"
        said = "–"
        if _is_interval(ends_a) and _is_interval(ends_b):
            said = "yes" if ends_a[1] < ends_b[0] or ends_b[1] < ends_a[0] else "no"
        rows.append((f"{name} ({unit})", number(a), interval(ends_a), number(b), interval(ends_b), change, said))

    one, two = first.content, second.content
    for key, unit in (("a0", "1/s"), ("b0", "N·m/(s·%)"), ("c0", "N·m/s")):
        a, b = one.get("linear") or {}, two.get("linear") or {}
        add(key, unit, a.get(key), b.get(key), (a.get("ci95") or {}).get(key), (b.get("ci95") or {}).get(key))
    for key in ("B_m", "B_M"):
        a, b = ((part.get("linear") or {}).get("bounds") or {} for part in (one, two))
        add(key, "%·s/(N·m)", a.get(key), b.get(key))
    for part in ("nonlinear", "linear"):
        add(f"RMSE of the {part} model", "N·m", (one.get(part) or {}).get("rmse"), (two.get(part) or {}).get("rmse"))
    levels = [{row["level"]: row for row in (part.get("friction") or {}).get("levels") or []} for part in (one, two)]
    unit_of_level = KINDS.get(first.kind, ("", ""))[1]
    for level in sorted(set(levels[0]) & set(levels[1])):
        a, b = levels[0][level], levels[1][level]
        for key in ("Ts", "tau1", "tau2"):
            add(
                f"{tables.SYMBOLS[key]} at {tables.level(level)} {unit_of_level}", tables.UNITS[key], a.get(key), b.get(key),
                (a.get("ci95") or {}).get(key), (b.get("ci95") or {}).get(key),
            )  # fmt: skip
    return Table(
        "Both fits", f"A is {first.source.path}, B is {second.source.path}.",
        ("value", "A", "A, 95 %", "B", "B, 95 %", "change", "beyond both intervals"), tuple(rows),
    )  # fmt: skip


def _is_interval(ends: Any) -> bool:
    return isinstance(ends, list | tuple) and len(ends) == 2 and all(isinstance(end, int | float) for end in ends)


def commands(results: Results) -> list[str]:
    """Command lines that make these files again, as far as the files tell."""
    lines = []
    for data in results.data:
        lines.append(f"eaid ingest LOGS -o {_quoted(data.source.path)}")
    for fit in results.fits:
        named = [data.source.path for data in results.data if data.steps.kind == fit.kind]
        behind = list(dict.fromkeys(str(item.get("path", "")) for item in (fit.content.get("data") or {}).get("sources") or [] if isinstance(item, Mapping)))
        given = " ".join(_quoted(path) for path in (named[:1] or behind[:6])) or "LOGS"
        lines.append(f"eaid fit {given} -o {_quoted(fit.source.path)}{_options(fit.content)}")
    clutch = results.fit("clutch")
    model = _quoted(clutch.source.path) if clutch else "fit.json"
    lines += [f"eaid tune-rc {model} -o {_quoted(gains.source.path)}{_options(gains.content)}" for gains in results.gains]
    with_gains = f" --gains {_quoted(results.gains[0].source.path)}" if results.gains else ""
    for replay in results.replays:
        names = ",".join(replay.traces)
        scenario = f" --scenario {_quoted(replay.scenario)}" if replay.scenario else ""
        seed = f" --seed {replay.options['seed']}" if isinstance(replay.options.get("seed"), int) else ""
        lines.append(f"eaid simulate {model}{with_gains}{scenario} --controller {_quoted(names)}{seed} -o {_quoted(replay.source.path)}")
    lines.append("eaid report " + " ".join(_quoted(source.path) for source in results.sources) + " -o report")
    return lines


def _options(content: Mapping[str, Any]) -> str:
    options = content.get("options")
    seed = options.get("seed") if isinstance(options, Mapping) else content.get("seed")
    return f" --seed {seed}" if isinstance(seed, int) and not isinstance(seed, bool) else ""


def _quoted(text: str) -> str:
    import shlex

    return shlex.quote(text)


GLOSSARY: tuple[tuple[str, str], ...] = (
    ("duty u", "share of the PWM period during which voltage is on, in percent; the clutch's input"),
    ("PWM", "pulse-width modulation: voltage switched on and off many times a second"),
    ("level", "one value of the input that was stepped to: a duty, a force or a speed"),
    ("T_s", "steady torque: what a step reaches after a long time"),
    ("τ1, τ2", "fast and slow time constant: after τ, 63 % of that part's rise is done"),
    ("C", "share of the torque that rises with the fast constant, 0.85 unless said otherwise"),
    ("C_f", "coefficient of friction: friction stress over normal stress"),
    ("B, B_m, B_M", "duty per rate of torque, 1/b0 of the linear model; its least and largest value over the levels"),
    ("fit", "the choice of a model's values that makes the sum of squared differences from the data least"),
    ("residual", "measured value minus the model's"),
    ("RMSE", "root mean square error: a typical size of the residuals, in the unit of the data"),
    ("sd", "standard deviation: how far repeats scatter around their mean"),
    ("95 % interval", "range that holds the true value in 95 of 100 such experiments, if the model is right"),
    ("autocorrelation", "how much a residual resembles itself a little later: 1 the same, 0 not at all"),
    ("joint, two-stage", "all levels fitted at once; or each level first and a curve through their values after"),
    ("solver", "the search for the least sum of squares (SLSQP); its result is checked by a test of our own"),
    ("RC, PI", "the paper's robust controller; a controller that uses the error and its integral"),
    ("ρ, α, φ, Q_M, ε, γ", "terms of the robust controller's condition for stability, inequality (15), and of its switch"),
    ("‖ξ‖", "size of the torque error and its integral taken together"),
    ("open loop", "the duty follows from the model alone, without looking at the torque"),
    ("replay", "a computed experiment: a controller on the fitted model of the clutch"),
    ("overshoot, settling time", "how far a step goes beyond its goal; how long until it stays within 2 % of it"),
    ("χ², AICc", "measures of closeness: the first counts squared misses in units of their scatter, the second adds a price for each value fitted"),
    ("margin", "how much gain, phase lag or delay a control loop bears before it becomes unstable"),
    ("p", "probability of so large a difference by chance alone"),
    ("dB", "decibel: 20 times the decimal logarithm of a ratio; 0 is equal, −6 is half"),
    ("synthetic", "computed from a known model with noise added; used where no recording was published"),
)
"""Word → meaning, for a reader who knows clutches but not our names."""
