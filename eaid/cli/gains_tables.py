"""The tables of `eaid tune-rc`, for people."""

from typing import Any

from eaid.cli import console


def show(result: dict[str, Any]) -> None:
    """Robust controller, PI, margins; one table each on stdout."""
    rc, pi, rho = result["rc"], result["pi"], result["rc"]["rho"]
    terms = rho["terms"]
    yes = {True: "yes", False: "NO", None: "not known"}
    console.table(
        "Robust controller",
        ["", "value", "unit", "what it is"],
        [
            ["B_m … B_M", f"{rc['B_m']:.5g} … {rc['B_M']:.5g}", "%·s/(N·m)", rc["bounds"]["convention"]],
            ["B̂", f"{rc['B_hat']:.5g}", "%·s/(N·m)", rc["B_hat_convention"]],
            ["K_P, K_D", f"{rc['K_P']:.5g}, {rc['K_D']:.5g}", "1/s², 1/s",
             f"natural frequency {rc['natural_frequency_rad_s']:.5g} rad/s, damping {rc['damping']:.4g}"],
            ["α", f"{rc['alpha']:.6g}", "1", f"by the formula; really reached with this B̂: {rc['alpha_reached']:.6g}"],
            ["Q_M", f"{rc['Q_M']:.5g}", "N·m/s", f"holds for the reference: {yes[rc['Q_M_holds']]}"],
            ["φ", f"{rc['phi']:.4g}", "", f"means {rc['phi_honest_pct']:.4g} % duty; holds: {yes[rc['phi_holds']]}"],
            ["ρ(ξ)", f"{rho['constant']:.6g} + {rho['slope']:.6g}·‖ξ‖", "N·m/s",
             f"{rho['convention']}; {terms['reference_nm_s']:.4g} for Q_M, {terms['phi_nm_s']:.4g} for φ"],
            *([f"  read as {name}", f"{row['constant']:.6g} + {row['slope']:.6g}·‖ξ‖", "N·m/s",
               f"φ = {row['phi']:.4g} then means {row['phi_honest_pct']:.4g} % duty"]
              for name, row in rho["readings"].items()),
            ["guaranteed", yes[rc["guaranteed"]], "", _needed(rho)],
            ["ε, γ", f"{rc['epsilon']:.4g}, {rc['gamma']:.4g}", "", "boundary layer and switch, in units of z"],
            ["z", f"{rc['Q'][1][0]:.5g} q̃ + {rc['Q'][1][1]:.5g} e", "", f"P = {rc['P'][0][0]:g}·I"],
            ["inside the layer", f"PI {rc['equal_pi']['K_P']:.4g}, {rc['equal_pi']['K_I']:.4g}",
             "%/(N·m), %/(N·m·s)", "plus feedforward"],
            ["outside it", f"{result['actuator']['robust_term_pct']:.4g}", "% duty",
             f"asked by the robust term; the actuator spans {result['actuator']['span_pct']:.4g}"],
            ["left at half torque", _left(result["actuator"]["points"][1]), "% of it", "by the duty limits"],
            ["error in the end", _bound(rc["ultimate_bound"]["torque_error_nm"]), "N·m", _replayed(result)],
        ],
    )  # fmt: skip
    settling = pi["settling_s"]
    console.table(
        "PI controller",
        ["", "value", "unit", "what it is"],
        [
            ["K_P, K_I", f"{pi['K_P']:.5g}, {pi['K_I']:.5g}", "%/(N·m), %/(N·m·s)",
             "from overshoot and settling" if pi["asked"] else "given"],
            ["overshoot", f"{pi['overshoot_pct']:.4g}", "%", "on the linear model, zero included"],
            ["settling", f"{settling:.4g}" if settling < float("inf") else "never", "s", "2 % band"],
        ],
    )  # fmt: skip
    if "optimized" in result:
        _optimized(result["optimized"])
    timing = result["margins"]["timing"]
    latch = f"duty latched at {timing['pwm_hz']:g} Hz" if timing["pwm_hz"] else "duty not latched"
    console.table(
        f"Margins around held duties, {timing['rate_hz']:g} Hz, {latch}",
        [
            "duty [%]",
            "torque [N·m]",
            "RC gain [dB]",
            "phase [°]",
            "delay [ms]",
            "PI gain [dB]",
            "phase [°]",
            "delay [ms]",
        ],
        [
            [f"{row['duty_pct']:.4g}", f"{row['torque_nm']:.3g}", *_margin(row["rc"]), *_margin(row["pi"])]
            for row in result["margins"]["points"]
        ],
    )


def _optimized(told: dict[str, Any]) -> None:
    rows = [
        ("RMS error", "rms_error_nm", "N·m"),
        ("  of the worst plant", "worst_plant_rms_error_nm", "N·m"),
        ("largest error", "max_abs_error_nm", "N·m"),
        ("chattering", "mean_abs_duty_step_pct", "% duty per sample"),
        ("at a limit", "saturated_fraction", "of the time"),
        ("P's scale", "p_scale", ""),
        ("ε", "epsilon", ""),
        ("φ", "phi_honest_pct", "% duty"),
        ("B̂", "B_hat", "%·s/(N·m)"),
        ("K_P", "K_P", "1/s²"),
        ("K_D", "K_D", "1/s"),
    ]
    before, after = told["before"], told["after"]
    console.table(
        f"Optimised on the {told['reference']}, {told['plants']} plants, noise {told['noise_nm']:.3g} N·m "
        f"({told['noise_source']}), chattering up to {told['limit_pct']:.3g} %",
        ["", "before", "after", "unit"],
        [[name, f"{before[key]:.5g}", f"{after[key]:.5g}", unit] for name, key, unit in rows],
    )


def _needed(rho: dict[str, Any]) -> str:
    need = rho["needed"]
    if need is None:
        return "the α reached is 1 or more: no ρ covers it"
    return f"Eq. (15) with the α reached asks for {need['constant']:.6g} + {need['slope']:.6g}·‖ξ‖"


def _left(point: dict[str, float]) -> str:
    return f"{100 * point['share_up']:.3g} up, {100 * point['share_down']:.3g} down"


def _bound(value: float) -> str:
    return f"{value:.4g}" if value < float("inf") else "no bound"


def _replayed(result: dict[str, Any]) -> str:
    told = result.get("replayed")
    if told is None:
        return "ultimate bound"
    worst, pi = told["rc"]["max_abs_error_nm"], told["pi"]["max_abs_error_nm"]
    return f"ultimate bound; replayed {told['reference']}: {worst:.3g} (PI {pi:.3g})"


def _margin(found: dict[str, float]) -> list[str]:
    if not found["stable"]:
        return ["unstable", "-", "-"]
    delay = found["delay_s"]
    return [
        f"{found['gain_db']:.3g}" if found["gain_db"] < float("inf") else "> 80",
        f"{found['phase_deg']:.3g}" if found["phase_deg"] < float("inf") else "gain below 1",
        f"{1e3 * delay:.3g}" if delay < float("inf") else "> 200",
    ]
