"""What `eaid simulate` prints: metrics as tables on stdout, in the rig's units."""

from eaid.cli import console
from eaid.cli.gains_tables import units
from eaid.results.metrics import Metrics
from eaid.results.replay import Replay


def show(replay: Replay) -> None:
    """Every table that the replay has."""
    recorded(replay)
    tracked = replay.metrics()
    if tracked:
        tracking(replay, tracked)
    best_found(replay)


def tracking(replay: Replay, tracked: dict[str, Metrics]) -> None:
    """The metrics of each controller."""
    i, o = replay.head.input_unit, replay.head.output_unit
    columns = ["controller", f"max |error| [{o}]", "RMS", "mean", f"IAE [{o}·s]", f"|Δu| [{i}]", "at limit"]
    rows = [
        [
            name,
            *map(_number, (m.max_abs_error_nm, m.rms_error_nm, m.mean_abs_error_nm, m.iae_nm_s)),
            _number(m.mean_abs_duty_step_pct, 3),
            f"{100 * (m.saturated_fraction or 0.0):.1f} %",
        ]
        for name, m in tracked.items()
    ]
    console.table(f"Tracking, scenario {replay.head.scenario}", columns, rows)
    for name, m in tracked.items():
        _steps(name, m, o)
        _tones(name, m, o)
        _modes(name, m)
        _guarantee(name, m)
        _plants(name, m)


def _steps(name: str, m: Metrics, unit: str) -> None:
    columns = [f"from [{unit}]", "to", "rise 10–90 %", "overshoot", "settling 2 %", "settling 5 %"]
    rows = [
        [f"{s.from_nm:g}", f"{s.to_nm:g}", _seconds(s.rise_time_s), f"{_number(s.overshoot_pct)} %",
         _seconds(s.settling_s), _seconds(s.settling_5pct_s)]
        for s in m.steps
    ]  # fmt: skip
    if rows:
        console.table(f"Steps, {name}", columns, rows)


def _tones(name: str, m: Metrics, unit: str) -> None:
    rows = [
        [f"{f.frequency_hz:.4g} Hz", "no response" if f.gain_db is None else f"{f.gain_db:.2f} dB",
         f"{f.phase_deg or 0.0:.1f}°", _number(f.mean_abs_error_nm)]
        for f in m.frequencies
    ]  # fmt: skip
    if rows:
        console.table(f"Sweep, {name}", ["frequency", "gain", "phase", f"mean |error| [{unit}]"], rows)


def best_found(replay: Replay) -> None:
    """The least error, how good it is, and how far each controller is from it."""
    found = replay.metrics("best").get("best")
    if found is None:
        return
    _, o = units("", replay.head.output_unit)
    rows = [["best found", _number(found.rms_error_nm), "", _number(found.max_abs_error_nm)]]
    for name, m in replay.metrics("controller").items():
        times = m.rms_over_best
        far = f"{times:.3g} times" if times is not None else f"{_number(m.rms_above_best_nm)} above"
        rows.append([name, _number(m.rms_error_nm), far, _number(m.max_abs_error_nm)])
    columns = ["controller", f"RMS [{o}]", "from the best", f"largest error [{o}]"]
    console.table("How far from the best", columns, rows)
    steady = f"without switching from sample to sample {_number(found.steady_rms_nm)} {o}"
    console.line(f"best duty: {verdict(found, o)}; {steady}")


def verdict(best: Metrics, unit: str) -> str:
    """How good the best duty is, in words."""
    least, bound = best.rms_error_nm or 0.0, best.bound_rms_nm or 0.0
    if least <= 1e-9:
        return "the reference is within the plant's reach: the least error is 0"
    if bound <= 0:
        return "found by local search; nothing is known about how much better one could do"
    return (
        f"a duty with this error exists, and none has less than {bound:.4g} {unit}, {100 * bound / least:.0f} % of it"
    )


def _modes(name: str, m: Metrics) -> None:
    """The rehabilitation by mode, and what may be concluded from it."""
    if not m.modes:
        return
    rows = []
    for mode, part in m.modes.items():
        error = part.abs_position_error_deg
        middle = f"{error.q1:.2f}…{error.q3:.2f}°"
        rows.append([mode, f"{error.median:.2f}°", middle, _number(part.mean_abs_torque_error_nm)])
    columns = ["mode", "median |error|", "middle half", "mean |torque error| [N·m]"]
    console.table(f"Rehabilitation, {name}", columns, rows)
    rows = [
        [" and ".join(test.modes), *map(_p, (test.samples.p, test.cycles.p_welch, test.cycles.p_rank,
                                             test.cycles.least_p_rank))]
        for test in m.tests
    ]  # fmt: skip
    columns = ["modes", "p, t on samples (paper)", "p, Welch on cycle means", "p, ranks of them", "least p of ranks"]
    console.table(f"Do the modes differ? {name}", columns, rows)


def _p(value: float | None) -> str:
    if value is None:
        return "too few cycles"
    return f"{value:.2g}" if value > 0 else "< 1e-300"


def _seconds(value: float | None) -> str:
    return "never" if value is None else f"{value:.3f} s"


def _number(value: float | None, digits: int = 4) -> str:
    return "-" if value is None else f"{value:.{digits}g}"


def _guarantee(name: str, m: Metrics) -> None:
    """How long the guarantee held, and why it did not."""
    if m.guarantee_holds_fraction is None:
        return
    row = [
        f"{100 * m.guarantee_holds_fraction:.2f} %", _number(m.guarantee_largest_chi_over_rho, 3),
        _share(m.guarantee_failures_at_limit), _share(m.guarantee_failures_by_saturation),
    ]  # fmt: skip
    columns = ["|χ| ≤ ρ for", "largest |χ|/ρ", "failures at a duty limit", "because of the limit"]
    console.table(f"Guarantee along this replay, {name}", columns, [row])


def _share(value: float | None) -> str:
    return "no failure" if value is None else f"{100 * value:.1f} %"


def _plants(name: str, m: Metrics) -> None:
    """The metrics over the plants that the fit allows."""
    if m.plants is None:
        return
    rows = [
        [
            metric,
            *("never" if value is None else f"{value:.4g}" for value in (one.low, one.median, one.high)),
            "never" if one.worst.value is None else f"{one.worst.value:.4g}",
            f"no. {one.worst.plant}",
            f"{one.never} of {m.plants.count} never" if one.never else "",
        ]
        for metric, one in m.plants.metrics.items()
    ]
    columns = ["metric", "2.5 %", "median", "97.5 %", "worst", "plant", ""]
    console.table(f"{m.plants.count} plants, {name}", columns, rows)
    worst = m.plants.metrics["max_abs_error_nm"].worst
    parts = (f"{key} [{', '.join(f'{x:.4g}' for x in getattr(worst, key))}]" for key in ("tau1", "tau2", "Ts"))
    console.line(f"largest error on plant no. {worst.plant}: {', '.join(parts)}")


def recorded(replay: Replay) -> None:
    """How far the model is from each recorded run."""
    runs, o = replay.metrics("recorded-input"), replay.head.output_unit
    rows = [
        [
            name, _number(m.rms_difference_nm), _number(m.max_abs_difference_nm),
            "–" if m.mean_difference_nm is None else f"{m.mean_difference_nm:+.4g}",
            f"{100 * m.R2:.2f} %" if m.R2 is not None else "output is constant", _number(m.fit_pct),
            _number(m.one_step_pct),
        ]
        for name, m in runs.items()
    ]  # fmt: skip
    if rows:
        columns = ["run", f"RMS difference [{o}]", "largest", "mean (recorded − model)", "R²", "free run fit [%]",
                   "one step [%]"]  # fmt: skip
        console.table("The recorded input through the plant", columns, rows)
