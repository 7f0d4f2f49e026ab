"""Sentences about control."""

from eaid.findings.row import Row, Values, caution, note, stop

CONDITION_WORDS = {"rho": "ρ", "phi": "φ", "Q_M": "Q_M", "duty-limit": "input limit", "duty-floor": "input floor"}


def _say_margin(v: Values) -> str:
    known = [f"{v[key]:.3g}{unit}" for key, unit in (("gain_db", " dB"), ("phase_deg", "°")) if v[key] is not None]
    law, least = v["subject"].upper(), ", ".join(known)
    missed = f"less than {v['enough_db']:g} dB or {v['enough_deg']:g}° of margin"
    return f"{law}: {missed} around {v['levels']} {v['unit']} (least {least})"


def _margins(v: Values) -> str:
    told = []
    for law, name in (("rc", "RC"), ("pi", "PI"), ("pi-feedforward", "PI with feedforward")):
        units = (("gain_db", "dB"), ("phase_deg", "° of phase"))
        parts = [f"{v[f'{law}_{key}']:.3g} {unit}" for key, unit in units if v.get(f"{law}_{key}") is not None]
        told += [f"{name} {', '.join(parts)}"] if parts else []
    return f"least margins around the held inputs: {'; '.join(told)}"


def _leaves(v: Values) -> str:
    parts = []
    if v["below_pct"] > 1:
        parts.append(f"{v['below_pct']:.0f} % of the time below {v['low']:.4g} {v['unit']}")
    if v["above_pct"] > 1:
        parts.append(f"{v['above_pct']:.0f} % above {v['high']:.4g} {v['unit']}")
    if v["falling_pct"] is not None and v["falling_pct"] > 1:
        parts.append(f"{v['falling_pct']:.0f} % of it is output that falls between inputs, which was not recorded")
    return f"the replay leaves what was recorded: {', '.join(parts)}; treat that as extrapolation"


ROWS: dict[str, Row] = {
    # Gains
    "phi-exceeded": caution(
        "the model's drift term is off by up to {needed:.3g} {unit}, the gains allow for {allowed:.3g} {unit}; «phi» "
        "data takes φ from the data"
    ),
    "slope-above-q-max": caution(
        "the {reference} is steeper ({slope:.3g} per second) than the gains assume ({Q_M:.3g}); «reference» "
        "{reference} takes Q_M from it"
    ),
    "rho-not-covered": caution(
        "ρ does not cover the uncertainty: with B̂ = {B_hat:.4g} the α really reached is {reached:.4g}, ρ was made "
        "with {made:.4g}; «b_hat» minimax closes it"
    ),
    "b-hat-between-levels": note(
        "B̂ is {B_hat:.4g}, the middle of what the levels need: 1/b0 of the model of all levels, {pooled:.4g}, is over "
        "twice the least, {B_m:.4g}, where no ρ is enough; «b_hat» pooled takes it all the same"
    ),
    "plants-beyond-actuator": caution(
        "along the {reference} a plant that the gains allow for may take more or less than the actuator has: there "
        "nothing holds the error; a slower reference in the middle of the range takes less"
    ),
    "margin-missed": caution(_say_margin),
    "fall-within-interval": caution(
        "T_s(u) falls around {levels} {unit}, the levels' T_s within their intervals do not: gains and margins are for "
        "a rig that rises there as it does beside it"
    ),
    "falls-taken-as-releases": caution(
        "no log shows falls from level to level: the loops are slower, to have their margins where these are as quick "
        "as falls to rest; steps down from level to level tell"
    ),
    "margin-less-in-falls": caution(
        lambda v: (
            f"the {v['subject'].upper()} loop has "
            + " and ".join(f"{v[key]:.3g}{unit}" for key, unit in (("gain_db", " dB"), ("phase_deg", "°")) if v[key])
            + " where falls between levels, which no log shows, are as quick as those to rest: the margins told are "
            "those of rises"
        )
    ),
    "margin-if-falls-are-releases": caution(
        lambda v: (
            f"the {v['subject'].upper()} loop has "
            + (f"{v['gain_db']:.3g} dB and {v['phase_deg']:.3g}°" if v["stable"] else "no margin")
            + " where falls between levels are as quick as those to rest, and no log shows such falls: record steps "
            "down from level to level"
        ),
        rank=0,
    ),
    "paper-pi": note(
        "beside it the paper's PI, 21 and 360: largest error {error:.3g} {unit}; {overshoot_pct:.3g} % overshoot and "
        "{settling_s:.3g} s on this linear model, not the 1 % and 0.27 s it was meant for; «pi_gains» 21,360 takes it"
    ),
    "rc-slowed": note(
        "RC: the paper's numbers leave it too little margin {loop}; made with ε {epsilon:.3g}, K_P {K_P:.3g}, K_D "
        "{K_D:.3g} instead"
    ),
    "switch-jumps": caution(
        "γε is {sharpness:.3g}, below {least:g}: the printed switch jumps by {jump:.2g} ρ at z = 0; eaid takes the "
        "jump out, so its law is no longer the printed one"
    ),
    "designed-for-rig": note(
        "not the paper's rig (input: {input_unit}, output: {output_unit}{kind}), so the law's numbers are made for "
        "this one's pace (a0 {pace:.3g} times the paper's) and range (input up to {highest:.4g}); φ is read off the "
        "data, the PI designed for {overshoot_pct:g} % and {settling_s:.3g} s"
    ),
    "control-rate-raised": caution(
        "the gains are for a controller of {rate_hz:g} Hz, {samples:.0f} samples in the rig's lag of {lag_s:.2g} s, "
        "where {usual_hz:g} Hz are usual; of another one say its rate with «rate_hz»"
    ),
    "controller-refused": note("{subject}: {why}"),
    "fit-not-usable": caution("made from a fit that is NOT USABLE: {why}"),
    "nothing-to-replay-on": note("the fit holds no nonlinear model, so no error is replayed"),
    "designed-for-latest": note(
        "margins, and the delay of Smith's predictor, are those of a dead time of {latest_s:.3g} s, the upper end of "
        "the interval of {dead_time_s:.3g} s: the rig may be as late"
    ),
    # Replays
    "replay-not-usable": caution("{subject} of a fit that is NOT USABLE ({why}): the replay is marked"),
    "reference-above-plant": caution(
        "the {subject} goes to {asked:.3g} {unit}, the fitted plant at its highest input to {highest:.3g} {unit}: its "
        "errors say nothing about the gains; give a «reference» within reach"
    ),
    "controller-at-limit": caution(
        "{subject}: its input lies at a limit {share_pct:.0f} % of the time, so its errors are the actuator's; try a "
        "slower or smaller «reference», or gentler gains",
        size="share_pct",
    ),
    "range-left-open": caution(
        lambda v: (
            f"the guarantee speaks of plants whose B lies within {v['B_m']:.4g} … {v['B_M']:.4g}, as fitted; the data "
            f"leave {v['low']:.4g} … {v['high']:.4g} open, and of plants beyond that range it says nothing"
            + "; more runs narrow it"
            * (v["low"] < v["B_M"] and v["high"] > v["B_m"])
        )
    ),
    "gains-of-another-fit": caution(
        "the gains were made from another fit ({path}), and their margins are those of its plant; run eaid tune-rc on "
        "this one, or compare both"
    ),
    "controller-cycles": caution(
        "{subject}: its input goes {count} times from one limit to the other, and the reference turns {turns} times: "
        "it cycles, on the noise that it reads or behind a dead time, and holds no output; take another controller, or "
        "gentler gains",
        size="count",
    ),
    "reference-above-q-max": caution(
        "the reference is as steep as {slope:.3g} per second; the gains were made for Q_M = {Q_M:g}"
    ),
    "plants-all-alike": caution(
        "this fit holds no covariance of the nonlinear model, so every drawn plant is the fitted one; fit again with "
        "«ci» robust to carry the uncertainty on"
    ),
    "dead-time-replayed": note(
        "the input acts {dead_time_s:.3g} s late, the dead time that the logs show; «delay_samples» adds to it"
    ),
    "log-without-creep": note("logs of the fit are compared without the creep of their output, as it was fitted"),
    "no-gains": note("no «gains», so rc and pi are left out; the controllers that need none are replayed"),
    "replay-leaves-identified": note(_leaves),
    # Walls
    "wall-beyond-stable": caution(
        "{subject}: a wall of {wanted:.3g} {per} is beyond what stays stable at {torque_nm:.3g} {unit} on this limb "
        "({stable:.3g} {per}); render a softer one, or with another loop",
        size="wanted",
    ),
    "wall-by-rate": note(
        "rc with its reference rate: {stable:.4g} {per} at {torque_nm:.3g} {unit} rests on fractions of a sample; "
        "without the rate it is {without:.3g}",
        size="stable",
    ),
    "clutch-cannot-turn": caution(
        "the limb may move faster than the rotor by {short:.3g} rad/s: there the clutch's torque turns round; a rotor "
        "of {needed_rpm:.3g} RPM does not let it"
    ),
    "wall-beyond-encoder": caution(
        "{subject}: walls above {encoder:.3g} {per} chatter on the encoder's steps, idle drag {drag:.3g} {unit}"
    ),
    # Exports
    "export-unstable": stop(
        "{subject}: the loop is unstable at {rate_hz:g} Hz around {levels} {unit}; ask for slower gains"
    ),
    "export-not-usable": stop("{subject} of a fit that is NOT USABLE: {why}"),
    "export-left-out": caution("the fit's plant has {what}, which an exported {subject} does not know: it is left out"),
    "export-no-dead-time": caution(
        "the exported {subject} knows no dead time, and the fit's is {dead_time_s:.3g} s: its margin is the less for it"
    ),
    "export-guarantee-holds": note("RC: the Lyapunov guarantee holds, for the reference that the gains were made for"),
    "export-guarantee-missing": caution(
        lambda v: (
            "RC: the Lyapunov guarantee does not hold on this rig (missing: "
            f"{', '.join(CONDITION_WORDS.get(name, name) for name in v['missing'])}); the margins are what speaks for "
            "these gains"
        )
    ),
    "export-margins": note(_margins),
    "export-guarantee-unknown": caution("RC: these gains do not say whether the guarantee holds"),
    "export-other-rate": caution(
        "exported for {rate_hz:g} Hz, the gains were made for {made_hz:g} Hz: their margins are not these"
    ),
    "replay-no-hysteresis": caution(
        "the replayed plant has no hysteresis, and the fit's is {excess_pct:.2g} %: only logs are played with it"
    ),
    "export-no-hysteresis": caution("the exported {subject} has no hysteresis, and the fit's is {excess_pct:.2g} %"),
    "export-sign-turned": caution(
        "the fit counts the output with its sign turned, as it falls where the input rises: `torque` is {idle:.4g} "
        "{unit} less what the rig measures, not that itself",
        rank=-1,
    ),
    "input-from-rest": caution(
        "every input here is counted from rest, which is {rest:g} {unit} on the rig: {low:.4g} to {high:.4g} {unit} "
        "are {rig_low:.4g} to {rig_high:.4g} {unit} there; add {rest:g} to what the rig is given"
    ),
    "export-from-rest": caution(
        "the {subject} counts output and reference from rest, where the rig measures {idle:.4g} {unit}: take that off "
        "each reading, and each reference, before it is given"
    ),
    "export-no-release": caution(
        "no release was fitted: how the output falls to rest is an assumption of the {subject}"
    ),
    "export-fault-outside": caution(
        "the input on fault, {duty:g} {unit}, lies outside the limits {low:g} to {high:g} {unit}"
    ),
    "export-anyway": caution("EXPORTED ANYWAY: a finding of severity stop stands; do not run it on a person"),
    # Files
    "result-written-anew": note(
        "{subject}: another program has written it anew: its digest no longer fits and is passed over"
    ),
    "part-left-out": caution("{subject}: its {part} has no {key} and is left out"),
}
