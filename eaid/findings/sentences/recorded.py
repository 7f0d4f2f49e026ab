"""Sentences about fits of recorded logs."""

from collections.abc import Callable

from eaid.findings.row import Row, Values, caution, note, stop

HOLD = {
    "Ts": "for longer than τ2",
    "tau1": "more often, coming from a lower input",
    "tau2": "for longer than τ2, coming from a lower input",
}
"""Parameter → how inputs have to be held to ask about it."""


def _falls(v: Values) -> str:
    return (
        f"falls between levels are not what rises are: their τ1 is {v['tau1_factor']:.3g} times and their τ2 "
        f"{v['tau2_factor']:.3g} times that of rises to the same input (chance {v['chance']:.2g}); τ1 and τ2 here are "
        "those of rises, and the replay takes them for falls too"
    )


def _other_law(v: Values) -> str:
    nearest = "" if v["fit_pct"] is None else f" (the nearest explains {max(v['fit_pct'], 0):.0f} % of its changes)"
    return (
        f"{v['subject']}: no PI law explains the duty of this loop{nearest}, so its margins and the tracking it should "
        f"have are not given; it misses its reference, {v['largest']:.3g} at most, by {v['rms']:.3g} (rms) and stands "
        f"at its limit for {v['saturated_pct']:.0f} % of the acting time"
    )


def _by_level(v: Values) -> str:
    names = {"rest": "falls to rest", "fall": "falls between levels", "excess": "T_s after a fall"}
    own = [said for name, said in names.items() if v[name]]
    if not own:
        return (
            "the friction model's levels do not confirm what the nonlinear model says of falls: their T_s, τ1 and τ2 "
            "are those of rises and falls together"
        )
    return (
        f"the friction model's T_s, τ1 and τ2 of each level are those of rises: {' and '.join(own)} differ there too, "
        "and have values of their own (recorded.friction_falls)"
    )


def _shifted(when: str, other: str, biased: bool) -> Callable[[Values], str]:
    """The sentence on an input that is noted late or early."""
    then = "by more than its interval: do not use it" if biased else "by less than its interval"
    alike = "; a dead time of the rig looks alike" if when == "early" else ""

    def said(v: Values) -> str:
        return (
            f"{v['subject']}: the output answers as if the input were noted {v['rows']} "
            f"{'row' if v['rows'] == 1 else 'rows'} ({v['ms']:.3g} ms) {when}: τ1 is wrong {then}; write the input "
            f"that acts from a row on into that row, or shift the column {v['rows']} {other}{alike}"
        )

    return said


ROWS: dict[str, Row] = {
    "recorded-not-converged": stop(
        "the fit of the logs did not converge: one more step would gain {predicted_decrease:.2g} of the cost"
    ),
    "input-faster-than-sampled": caution(
        "{subject}: the input jumps from row to row in {share_pct:.0f} % of the acting time: it moves faster than it "
        "is sampled, and what acted between the rows is not known; log it faster, or log its mean",
        "share_pct",
    ),
    "input-never-moves": caution(
        "{subject}: the input never moves (it stays at {level:g}): what is left of the state before it and the way to "
        "its steady value are one curve; record the step that leads there, from rest"
    ),
    "input-late": caution(_shifted("late", "up", False), "rows"),
    "input-early": caution(_shifted("early", "down", False), "rows"),
    "input-late-biases": stop(_shifted("late", "up", True), "rows"),
    "input-early-biases": stop(_shifted("early", "down", True), "rows"),
    "input-saturates": caution(
        "{subject}: the input stands at its limit ({limit:g}) for {share_pct:.0f} % of the acting time: it tells "
        "little there; lower the reference or the gains",
        "share_pct",
    ),
    "output-saturates": caution(
        "{subject}: the output stands at its largest value ({limit:.4g}) in {share_pct:.0f} % of the rows: the sensor "
        "or its amplifier is at its end; the fit takes that for the steady value",
        "share_pct",
    ),
    "one-input-only": caution(
        "the logs excite one input only ({levels}): T_s, τ1 and τ2 are known there; how they go with the input is not"
    ),
    "few-inputs": note("the logs hold {count:#input} only ({levels}): the polynomials have no more terms than that"),
    "idle-not-seen": caution(
        "{subject}: the log never rests, so its idle output is not known apart from T_s; 0 is taken: begin the log "
        "with a second at rest"
    ),
    "never-asked": caution(
        lambda v: (
            f"the input never asked about {v['symbol']} at {v['levels']}: its interval there is wider than "
            f"± {v['limit_pct']:g} %; hold these inputs {HOLD[v['parameter']]}"
        )
    ),
    "release-differs": note(
        "falls to rest have time constants of their own, {tau1_s:.3g} s and {tau2_s:.3g} s (the lowest input would "
        "give {edge1_s:.3g} s and {edge2_s:.3g} s; chance {chance:.2g}); they are fitted and taken for the release"
    ),
    "release-alike": note(
        "falls to rest are as fast as the lowest input gives, {tau1_s:.3g} s and {tau2_s:.3g} s, as far as these logs "
        "can tell (chance {chance:.2g})"
    ),
    "release-not-seen": note(
        "the logs hold no fall to rest: that a release goes as at the lowest input is an assumption"
    ),
    "falls-differ": caution(_falls),
    "hysteresis": caution(
        "the steady output depends on where the input came from: {excess_pct:+.2g} % after a fall of the input "
        "(chance {chance:.2g}); T_s here is that after rises"
    ),
    "friction-falls": note(_by_level),
    "friction-falls-alike": note(
        "the friction model's T_s, τ1 and τ2 of each level hold for rises and falls alike: the test on all levels "
        "together shows no difference, and none is asked of single ones"
    ),
    "engagements-scatter": note(
        "the output differs between engagements by {scatter_pct:.2g} % (sd of {count}); the intervals hold it"
    ),
    "engagements-few": note(
        "between rests the logs hold {count:#stretch} under load: how much the output differs from one to the next is "
        "not seen; let the recording return to rest four times or more"
    ),
    "duty-follows-output": caution(
        "{subject}: the input answers the noise of the output (correlation {correlation:.2f}): the log comes from a "
        "closed loop, and a direct fit is biased by as much as the noise"
    ),
    "loop-bias": caution(
        "closed loop: {refits} refits on simulated loops like this one miss the truth by {Ts_pct:.2g} % in T_s, "
        "{tau1_pct:.2g} % in τ1 and {tau2_pct:.2g} % in τ2 (mean error over the inputs it used), because the duty "
        "carries the noise; the intervals of the curves are wider by that, «instrument» removes it"
    ),
    "loop-bias-small": note(
        "closed loop: refits on {refits} simulated loops like this one show a bias of {Ts_pct:.2g} % in T_s, "
        "{tau1_pct:.2g} % in τ1 and {tau2_pct:.2g} % in τ2, less than their scatter"
    ),
    "loop-bias-unknown": caution(
        "{subject}: a closed loop whose law is not known: the bias of the direct fit cannot be told, and the intervals "
        "leave it out; log the reference of a PI loop, or play a duty of your own"
    ),
    "loop-law-unknown": note(_other_law),
    "loop-instrument": note(
        "{subject}: fitted with the simulated duty as an instrument: the noise that the duty carries has no say"
    ),
    "loop-tracks-otherwise": caution(
        "{subject}: the recorded loop misses its reference by {rms:.3g} (rms), the fitted model predicts "
        "{predicted:.3g}: something in the loop is not in the model"
    ),
    "excitation-short": caution(
        "no sequence of {most_s:g} s within the limits reaches the widths: {parameter} comes to ± {width_pct:.3g} %, "
        "not {wanted_pct:g} %"
    ),
}
