"""What `eaid simulate` prints: metrics as tables on stdout."""

from typing import Any

from eaid.cli import console


def tracking(scenario: str, results: dict[str, Any]) -> None:
    """The metrics as tables on stdout."""
    columns = ["controller", "largest error", "RMS", "mean", "IAE", "mean |Δu|", "saturated"]
    rows = [
        [
            name,
            f"{m['max_abs_error_nm']:.4g} N·m",
            f"{m['rms_error_nm']:.4g} N·m",
            f"{m['mean_abs_error_nm']:.4g} N·m",
            f"{m['iae_nm_s']:.4g} N·m·s",
            f"{m['mean_abs_duty_step_pct']:.3g} %",
            f"{100 * m['saturated_fraction']:.1f} %",
        ]
        for name, m in results.items()
    ]
    console.table(f"Tracking, scenario {scenario}", columns, rows)
    for name, m in results.items():
        if "steps" in m:
            columns = ["from", "to", "rise 10–90 %", "overshoot", "settling 2 %", "settling 5 %"]
            rows = [
                [
                    f"{s['from_nm']:g} N·m",
                    f"{s['to_nm']:g} N·m",
                    _seconds(s["rise_time_s"]),
                    f"{s['overshoot_pct']:.1f} %",
                    _seconds(s["settling_s"]),
                    _seconds(s["settling_5pct_s"]),
                ]
                for s in m["steps"]
            ]
            console.table(f"Steps, {name}", columns, rows)
        if "frequencies" in m:
            rows = [
                [
                    f"{f['frequency_hz']:g} Hz",
                    f"{f['gain_db']:.2f} dB" if f["gain_db"] is not None else "no response",
                    f"{f['phase_deg']:.1f}°",
                    f"{f['mean_abs_error_nm']:.4f} N·m",
                ]
                for f in m["frequencies"]
            ]
            console.table(f"Sweep, {name}", ["frequency", "gain", "phase", "mean |error|"], rows)
        if "modes" in m:
            _modes(name, m)
        if "guarantee_holds_fraction" in m:
            _guarantee(name, m)
        if "plants" in m:
            _plants(name, m["plants"])


def best_found(best: dict[str, Any], results: dict[str, Any]) -> None:
    """The least error, how good it is, and how far each controller is from it."""
    if not best:
        return
    rows = [["best found", f"{best['rms_error_nm']:.4g} N·m", "", f"{best['max_abs_error_nm']:.4g} N·m"]]
    for name, m in results.items():
        times = m["rms_over_best"]
        far = f"{times:.3g} times" if times is not None else f"{m['rms_above_best_nm']:.4g} N·m above"
        rows.append([name, f"{m['rms_error_nm']:.4g} N·m", far, f"{m['max_abs_error_nm']:.4g} N·m"])
    console.table("How far from the best", ["controller", "RMS", "from the best", "largest error"], rows)
    console.line(
        f"best duty: {best['verdict']}; without switching from sample to sample {best['steady_rms_nm']:.4g} N·m"
    )


def _modes(name: str, m: dict[str, Any]) -> None:
    """The rehabilitation by mode, and what may be concluded from it."""
    rows = []
    for mode, part in m["modes"].items():
        error = part["abs_position_error_deg"]
        middle = f"{error['q1']:.2f}…{error['q3']:.2f}°"
        rows.append([mode, f"{error['median']:.2f}°", middle, f"{part['mean_abs_torque_error_nm']:.4f} N·m"])
    console.table(f"Rehabilitation, {name}", ["mode", "median |error|", "middle half", "mean |torque error|"], rows)
    rows = [
        [
            " and ".join(test["modes"]),
            _p(test["samples"]["p"]),
            _p(test["cycles"]["p_welch"]),
            _p(test["cycles"]["p_rank"]),
            _p(test["cycles"]["least_p_rank"]),
        ]
        for test in m["tests"]
    ]
    columns = ["modes", "p, t on samples (paper)", "p, Welch on cycle means", "p, ranks of them", "least p of ranks"]
    console.table(f"Do the modes differ? {name}", columns, rows)


def _p(value: float | None) -> str:
    if value is None:
        return "too few cycles"
    return f"{value:.2g}" if value > 0 else "< 1e-300"


def _seconds(value: float | None) -> str:
    return "never" if value is None else f"{value:.3f} s"


def _guarantee(name: str, m: dict[str, Any]) -> None:
    """How long the guarantee held, and why it did not."""
    row = [
        f"{100 * m['guarantee_holds_fraction']:.2f} %",
        f"{m['guarantee_largest_chi_over_rho']:.3g}",
        _share(m["guarantee_failures_at_limit"]),
        _share(m["guarantee_failures_by_saturation"]),
    ]
    columns = ["|χ| ≤ ρ for", "largest |χ|/ρ", "failures at a duty limit", "because of the limit"]
    console.table(f"Guarantee, {name}", columns, [row])


def _plants(name: str, plants: dict[str, Any]) -> None:
    """The metrics over the plants that the fit allows."""
    rows = []
    for metric, m in plants["metrics"].items():
        worst = m["worst"]
        rows.append(
            [
                metric,
                *(f"{m[key]:.4g}" if key in m else "never" for key in ("p2.5", "median", "p97.5")),
                f"{worst['value']:.4g}" if worst["value"] is not None else "never",
                f"no. {worst['plant']}",
                f"{m['never']} of {plants['count']} never" if "never" in m else "",
            ]
        )
    columns = ["metric", "2.5 %", "median", "97.5 %", "worst", "plant", ""]
    console.table(f"{plants['count']} plants, {name}", columns, rows)
    metric = "max_abs_error_nm"
    worst = plants["metrics"][metric]["worst"]
    parts = (f"{key} [{', '.join(f'{value:.4g}' for value in worst[key])}]" for key in ("tau1", "tau2", "Ts"))
    console.line(f"largest error on plant no. {worst['plant']}: {', '.join(parts)}")


def recorded(runs: dict[str, Any]) -> None:
    """How far the model is from each recorded run."""
    rows = [
        [
            name,
            f"{m['rms_difference_nm']:.4g} N·m",
            f"{m['max_abs_difference_nm']:.4g} N·m",
            f"{m['mean_difference_nm']:+.4g} N·m",
            f"{100 * m['explained_variance']:.2f} %" if m["explained_variance"] is not None else "torque is constant",
        ]
        for name, m in runs.items()
    ]
    columns = ["run", "RMS difference", "largest", "mean (recorded − model)", "variance explained"]
    console.table("The recorded duty through the plant", columns, rows)


def _share(value: float | None) -> str:
    return "no failure" if value is None else f"{100 * value:.1f} %"
