"""Sentences about control."""

from eaid.findings.row import Row, Values, caution, note


def _margin(v: Values) -> str:
    least = [f"{v[key]:.3g}{unit}" for key, unit in (("gain_db", " dB"), ("phase_deg", "°")) if v[key] is not None]
    return (
        f"{v['subject'].upper()}: less than {v['enough_db']:g} dB or {v['enough_deg']:g}° of margin around "
        f"{v['levels']} {v['unit']} (least {', '.join(least)})"
    )


def _unstable(v: Values) -> str:
    return (
        f"{v['subject'].upper()}: unstable around {v['levels']} {v['unit']} on the fitted plant; ask for slower gains"
    )


ROWS: dict[str, Row] = {
    "loop-unstable-on-plant": caution(_unstable),
    "phi-exceeded": caution(
        "φ does not hold: ρ allows |η − η̂| up to {allowed:.3g} {unit}, the data ask for {needed:.3g} {unit} ({where}); "
        "«phi» data takes it from there"
    ),
    "slope-above-q-max": caution(
        "Q_M does not hold for the {reference}: it rises at up to {slope:.4g} per second, Q_M is {Q_M:.4g}; "
        "«reference» takes it from there"
    ),
    "rho-not-covered": caution(
        "ρ does not cover the uncertainty: with B̂ = {B_hat:.4g} the α really reached is {reached:.4g}, ρ was made with "
        "{made:.4g}; «b_hat» minimax or «alpha» reached closes it"
    ),
    "robust-term-beyond-actuator": caution(
        "outside the boundary layer the robust term alone asks for {asked:.3g} {unit}, the actuator spans {span:.3g} "
        "{unit}: there the Lyapunov argument does not hold on the real clutch"
    ),
    "no-ultimate-bound": caution(
        "no ultimate bound on the torque error follows from these gains: V may rise without end"
    ),
    "margin-missed": caution(_margin),
    "paper-pi-misses": caution(
        "the paper's PI, 21 and 360, gives {overshoot_pct:.3g} % overshoot and {settling_s:.3g} s on this linear "
        "model, not the 1 % and 0.27 s it was meant for; «pi_overshoot» 1 with «pi_settling» 0.27 does"
    ),
    "switch-jumps": caution(
        "γε is {sharpness:.3g}, below {least:g}: the printed switch jumps by {jump:.2g} ρ at z = 0; eaid takes the "
        "jump out, so its law is no longer the printed one"
    ),
    "designed-for-rig": note(
        "input in {input_unit}, output in {output_unit}: not the paper's rig, so the law's numbers are made for this "
        "one's pace (a0 {pace:.3g} times the paper's) and range (0 to {highest:.4g} {input_unit}); φ is read off the "
        "data, the PI designed for {overshoot_pct:g} % and {settling_s:.3g} s"
    ),
    "fit-not-identifiable": caution("made from a fit that is marked not identifiable: {why}"),
    "nothing-to-replay-on": note("the fit holds no nonlinear model, so no error is replayed beside the ultimate bound"),
    "reference-beyond-plant": caution(
        "the {reference} asks for up to {asked:.3g} {unit}, the fitted plant makes {highest:.3g} {unit} at most: its "
        "errors say nothing about the gains; give a «reference» within reach"
    ),
    "search-on-fitted-plant": caution(
        "this fit holds no covariance of the nonlinear model, so every drawn plant is the fitted one; fit again with "
        "«ci» robust to carry the uncertainty on"
    ),
    "noise-supposed": caution(
        "no logs to take the torque noise from: {noise:g} is supposed; give «noise_nm» or «data»"
    ),
}
