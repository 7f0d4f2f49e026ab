"""Sentences about fits: what the curves of single levels, the nonlinear and the linear model cannot tell."""

from eaid.findings.row import Row, Values, caution, note, stop

CONSTRAINTS = {
    "tau1-floor": "τ1 is at its floor of 1 ms",
    "tau2-meets-tau1": "τ2 has fallen to τ1",
    "Ts-zero": "T_s is at 0",
    "tau2-endless": "τ2 has no end",
    "C-zero": "C is at 0",
    "C-one": "C is at 1",
    "a0-fastest": "1/a0 is a hundredth of a sample",
    "a0-slowest": "1/a0 is a thousand record lengths",
    "release-tau1-floor": "τ1 of the release is at its floor of 1 ms",
    "release-tau2-meets-tau1": "τ2 of the release has fallen to its τ1",
    "fall-tau1-least": "τ1 of falls is a fiftieth of that of rises",
    "fall-tau2-least": "τ2 of falls is a fiftieth of that of rises",
    "hysteresis-least": "T_s after a fall is a fifth of that after a rise",
}
"""What each constraint of `Solver.at_bounds` says."""


def _constraint(values: Values) -> str:
    where = f" (from {' to '.join(f'{u:.4g}' for u in values['each'])})" if values["each"] else ""
    said = CONSTRAINTS.get(values["constraint"], values["constraint"])
    return f"a constraint holds the fit: {said}{where}; what it holds is not estimated there"


ROWS: dict[str, Row] = {
    "fit-not-converged": stop(
        "the {subject} fit did not converge: a further step would still lower its cost by {predicted_decrease:.0e} "
        "of it; do not use its numbers"
    ),
    "level-not-converged": stop("the curve {at} did not converge: do not use its numbers, nor what rests on it"),
    "curve-explains-little": stop(
        "two exponentials explain little of the output {at}: this is no single step response; look at the "
        "plot for several steps, a closed loop or a disturbance, and give «step_at» and «until»"
    ),
    "model-explains-little": stop(
        lambda v: (
            f"the {v['subject']} model explains little of the outputs"
            + (f" (R² {v['R2']:.2g})" if v.get("R2") is not None else "")
            + ": do not use its numbers"
        )
    ),
    "fast-rise-not-resolved": caution("τ1 is at its floor of 1 ms {at}: the fast rise is not resolved"),
    "output-does-not-rise": caution("T_s is at 0 {at}: the output does not rise with the step; check its sign"),
    "level-is-no-stress": caution(
        "C_f was not computed and the trends run over the level itself: a level in {unit} is neither a force nor a "
        "stress; say so with «units» input=N"
    ),
    "output-is-no-torque": caution("C_f was not computed: Eq. (1) takes a torque in N·m, and the output is in {unit}"),
    "trend-needs-levels": note(
        "no trend of {symbol} over {over}: a {form} trend needs at least {least} levels, there are {count}"
    ),
    "trend-rates-merge": note(
        "the two rates of the trend of {symbol} merge: its limit (p + q x) e^(r x) is given; a pair would be "
        "two huge weights that cancel"
    ),
    "trend-follows-one-point": caution(
        "the trend of {symbol} has a rate as steep as is looked for: it follows one point, not a trend"
    ),
    "trend-not-converged": caution("the trend of {symbol} did not converge"),
    "huber-holds-back-much": caution(
        "Huber's loss holds back more than {most_pct:.0f} % of the samples at level {levels}: that is wider scatter or "
        "another shape there, not spikes; these levels count less, compare with «loss» squares"
    ),
    "constraint-holds": caution(_constraint, rank=3),
    "starts-end-apart": note("{higher} of {starts} starts ended at a higher cost; the least is given"),
    "held-out-beyond-the-levels": note(
        "held-out level {levels} lies outside the fitted ones: the model, held at its edge there, predicts nothing"
    ),
    "a0-not-determined": caution("a0 is at the edge of what is looked for: these data cannot tell it"),
    "linear-output-negative": caution("the linear model gives a negative output at level {levels}"),
    "linear-level-beyond-record": caution(
        "1/a0 is longer than the record at level {levels}: gain and B of these levels are extrapolated"
    ),
    "level-without-b": caution("b0 is not positive at level {levels}: left out of B_m and B_M"),
    "release-beyond-record": caution(
        "the slow release constant ({tau2_s:.3g} s) is longer than the longest record after a release "
        "({record_s:.3g} s): these data cannot tell it"
    ),
    "release-too-fast": caution(
        "the release is faster than 1 ms or than the samples can tell: its fast constant is at its floor"
    ),
    "release-one-exponential": note("one exponential is enough for the releases: τ1 and τ2 coincide"),
    "release-leaves-output": caution(
        "more than a tenth of the output is left long after the release of level {levels}; the model's release goes "
        "to zero"
    ),
}
