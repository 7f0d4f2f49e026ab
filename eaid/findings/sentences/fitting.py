"""Sentences about fits: what the curves of single levels, the nonlinear and the linear model cannot tell."""

from collections.abc import Sequence

from eaid.findings.row import SYMBOLS, Row, Values, caution, note, stop
from eaid.shown import counted, listed

# What each constraint of `Solver.at_bounds` says
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
    "fall-tau1-most": "τ1 of falls is fifty times that of rises",
    "fall-tau2-most": "τ2 of falls is fifty times that of rises",
    "hysteresis-least": "T_s after a fall is a fifth of that after a rise",
}
CAUSES = {
    "one-exponential": "one exponential is all that most of them show",
    "short-record": "hold each level longer than {record_s:.3g} s",
    "decays": "the output decays under hold there, which no longer hold mends",
    "records": "the records do not show it",
}
# Parameter → how inputs have to be held to ask about it
HOLD = {
    "Ts": "for longer than τ2",
    "tau1": "more often, coming from a lower input",
    "tau2": "for longer than τ2, coming from a lower input",
}
LAGS_IN_WORDS = {
    "lag": "one lag", "series": "two lags in series", "ringing": "two states that ring",
    "zero": "two lags with a zero", "clutch": "the clutch's two lags over the input",
    "parallel": "two lags in parallel", "overshoot": "two lags that overshoot",
}  # fmt: skip
SMALL_CHANGES = ", which no model here has; gains and intervals hold for small changes at most"
# What residuals follow beside the plant's own
FOLLOWED = {
    "size": f"the input, in a form{SMALL_CHANGES}",
    "direction": f"which way the input last moved, as play, dry friction or hysteresis make it{SMALL_CHANGES}",
    "changes": "how the input has just changed, as a filter of the output makes it, which is no dead time: τ1 and τ2 "
    "hold it, too, and their intervals do not know of it",
}


def _constraint(values: Values) -> str:
    where = f" (from {' to '.join(f'{u:.4g}' for u in values['each'])})" if values["each"] else ""
    said = CONSTRAINTS.get(values["constraint"], values["constraint"])
    return f"a constraint holds the fit: {said}{where}; what it holds is not estimated there"


def _joined(names: Sequence[str]) -> str:
    return " and ".join(SYMBOLS[name] for name in names)


def _tau2_open(v: Values) -> str:
    low, high = v["low_s"], v["high_s"]
    if low is not None and high is not None:
        said = f"is anywhere between {low:.2g} and {high:.2g} s"
    elif low is not None:
        said = f"is {low:.2g} s or anything above"
    else:
        said = f"is anything up to {high:.2g} s" if high is not None else "may be anything"
    if v["curve_half_width"] is None:
        return f"{v['at']} τ2 {said}; the record is {v['record_s']:.3g} s long"
    known = f"{v['curve_half_width']:.1g} {v['output_unit']}".rstrip()
    return f"{v['at']} τ2 {said}; the curve itself is known to {known} within the record of {v['record_s']:.3g} s"


def _parted(v: Values) -> str:
    ends = f" ({v['low']:.3g} … {v['high']:.3g})" if v["low"] is not None else ", not well known there"
    return f"{v['symbol']} at {v['worst']:g}: joint {v['joint']:.3g}, else {v['other']:.3g}{ends}"


def _decays(v: Values) -> str:
    count = len(v["each"])
    more = f" and at {count - 1} more levels" if count > 1 else ""
    where = f"{v['worst']:g} {v.get('unit') or ''}".rstrip()
    most = 2 * count > v["of"]
    done = "; end the window before it does («until»), or take T_s for an average" if most else ""
    return (
        f"the output overshoots and decays under hold: {v['lost_pct']:.0f} % of its peak is lost by the end at {where}"
        f"{more}; no sum of rising exponentials shows that, so T_s is an average and τ2 means nothing there{done}"
    )


def kind_in_words(kind: str) -> str:
    """`lag+dead`: one lag with a dead time."""
    name, _, dead = kind.partition("+")
    return LAGS_IN_WORDS[name] + " with a dead time" * bool(dead)


def _say_kind(v: Values) -> str:
    said = f"the plant is {kind_in_words(v['kind'])}: {v['fit_pct']:.4g} % of these logs with {v['unknowns']} unknowns"
    if v["clutch_pct"] is None:
        return said
    clutch = f"where {LAGS_IN_WORDS['clutch']} have {v['clutch_pct']:.4g} % with {v['clutch_unknowns']}"
    return f"{said}, {clutch}"


def _say_falls(v: Values) -> str:
    each = [f"their {name} is {factor:.3g} times" for name, factor in zip(("τ1", "τ2"), v["factors"], strict=False)]
    return (
        f"falls between levels are not what rises are: {' and '.join(each)} that of rises to the same input (chance "
        f"{v['chance']:.2g}); time constants here are those of rises, and the plant has falls of its own"
    )


ROWS: dict[str, Row] = {
    # Models
    "fit-not-converged": stop(
        lambda v: f"the {v['subject']}{' fit' * (v['subject'] != 'fit')} did not converge; do not use its numbers"
    ),
    "curve-of-no-plant": stop(
        lambda v: (
            f"the fit's nonlinear.{v['name']} is {v['value']:.3g}{'' if v['name'] == 'Ts' else ' s'} at an input of "
            f"{v['input']:.4g}{', below tau1' if v['crossed'] else ''}, which no plant has; fit again"
        )
    ),
    "steady-beyond-output": stop(
        "the {subject} model's steady output, {steady:.3g} {unit}, lies far beyond the {reached:.3g} {unit} that were "
        "reached: the records do not show it; hold the levels for longer"
    ),
    "steady-output-unknown": stop(
        "the data leave T_s open {at} by a factor of a hundred or more; record from rest, hold the levels for longer"
    ),
    "linear-parameter-unknown": stop(
        lambda v: (
            f"{v['parameter']} of the linear model may lie anywhere between {v['low']:.3g} and {v['high']:.3g}; record "
            "more levels, held for longer"
            if v["high"] > 0
            else f"{v['parameter']} of the linear model is below 0 ({v['low']:.4g} … {v['high']:.4g}): more input "
            "gives less output; look for a log whose columns are exchanged, or whose sign is turned"
        )
    ),
    "no-step-has-a-shape": stop(
        "no single step has the shape of a step response: look at the plot for several steps, a closed loop or a "
        "disturbance, and give «step_at» and «until»"
    ),
    "curve-explains-little": stop(
        "two exponentials explain little of the output {at}: this is no single step response; look at the "
        "plot for several steps, a closed loop or a disturbance, and give «step_at» and «until»"
    ),
    "output-stays-at-rest": stop(
        "the output stays at rest {at}: the input does not act there, or the sensor does not see it; between there and "
        "the next level it begins to act, and the model knows nothing of it"
    ),
    "model-explains-little": stop("the {subject} model explains little of the outputs; do not use its numbers"),
    "fast-rise-not-resolved": caution("τ1 is at its floor of 1 ms {at}: the fast rise is not resolved"),
    "output-does-not-rise": caution("T_s is at 0 {at}: the output does not rise with the step; check its sign"),
    "level-is-no-stress": caution(
        "C_f was not computed and the trends run over the level itself: a level in {unit} is neither a force nor a "
        "stress; say so with «units» input=N"
    ),
    "output-is-no-torque": caution("C_f was not computed: Eq. (1) takes a torque in N·m, and the output is in {unit}"),
    "rig-unknown": caution(
        "C_f was not computed: Eq. (1) takes the rig's radii and friction surfaces; say them with «apparatus»"
    ),
    "trend-needs-levels": note(
        "no trend of {symbol} over {over}: a {form} trend needs at least {least} levels, there are {count}"
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
    "held-out-beyond-the-levels": note(
        "held-out level {levels} lies outside the fitted ones: the model, held at its edge there, predicts nothing"
    ),
    "linear-output-negative": caution("the linear model gives a negative output at level {levels}"),
    "linear-level-beyond-record": caution(
        "1/a0 is longer than the record at level {levels}: gain and B of these levels are extrapolated"
    ),
    "level-without-b": caution("b0 is not positive at level {levels}: left out of B_m and B_M"),
    "level-at-rest": caution("the output all but stays at rest at level {levels}: left out of B_m and B_M"),
    "release-beyond-record": caution(
        "the slow release constant ({tau2_s:.3g} s) is longer than the longest record after a release "
        "({record_s:.3g} s): these data cannot tell it"
    ),
    "release-too-fast": caution(
        "the release is faster than 1 ms or than the samples can tell: its fast constant is at its floor"
    ),
    "release-leaves-output": caution(
        "more than a tenth of the output is left long after the release of level {levels}; the model's release goes "
        "to zero"
    ),
    # Intervals
    "numbers-beyond-measure": caution(
        "some numbers are beyond any measure and are left out: the data do not tell them"
    ),
    "taus-meet": caution(
        lambda v: (
            f"{v['at']} τ1 and τ2 meet, neither is estimable by itself: all that the records show is one exponential, "
            f"of {', '.join(f'{tau:g}' for tau in v['taus_s'])} s"
        )
    ),
    "parameter-constrained": caution("{at} {symbol} is not estimable: a constraint holds it"),
    "tau2-open": caution(_tau2_open),
    "tau2-outlasts-record": caution("{at} τ2 is longer than the record of {record_s:.3g} s; record longer"),
    "no-level-determines-all": caution("no level determines all of T_s, τ1 and τ2", rank=1),
    "free-share-open": caution(
        "{at} the free C is anywhere between {low:.2f} and {high:.2f}: C and τ2 trade against each other; hold C"
    ),
    "one-level-nonlinear": caution(
        "one level only: nothing says how T_s, τ1 and τ2 change with the input; record more levels",
        rank=1,
        covers=("one-level-linear",),
        first="record more levels",
    ),
    "few-levels-for-polynomials": caution(
        "{count:#level} pin the polynomials of T_s, τ1, τ2 exactly or not at all: between the levels nothing checks "
        "their shape, and no interval there holds; record more levels"
    ),
    "parameter-unknown-at-half-the-levels": caution(
        lambda v: (
            f"{v['symbol']} is not determined at {v['count']} of {v['of']} levels: {CAUSES[v['cause']].format(**v)}"
        ),
        rank=1,
        covers=("no-level-determines-all",),
    ),
    "share-free": caution(
        "C is free ({C:.3g}): it trades against τ2 wherever the record is not several τ2 long, and T_s and τ2 are less "
        "sure for it; hold C unless the data ask for another"
    ),
    "share-by-evidence": note(
        "the logs reject C = {held:g} and tell C = {C:.3g} ({low:.3g} … {high:.3g}), which the plant now has; a gain "
        "that fades within the holds and a sensor that is slow look so too"
    ),
    "fast-part-unseen": caution(
        "the runs ask for C = {C:.2g} with a fast part of {fast_s:.2g} s, {rows:.2g} rows: an input noted late, or "
        "a sensor that jumps, looks so; C is held at {held:g}; log faster, and note the input when it is switched"
    ),
    "one-level-linear": caution(
        "one level only: one step cannot tell b0 from c0, only b0 u + c0 is known; record a second level", rank=1
    ),
    "linear-may-be-zero": caution(
        lambda v: (
            f"{v['parameter']} may be zero or negative"
            + (f" (95 % interval {v['low']:.3g} to {v['high']:.3g})" if v["low"] is not None else "")
            + ": record longer, or more levels"
        ),
        rank=1,
    ),
    "single-runs-few-levels": caution(
        "one run a level and too few levels to see run-to-run scatter: the intervals hold one run's own noise and, for "
        "the rest, a scatter of 3 % in T_s and 5 % in τ, as usual; repeat each level three times",
        rank=0,
        first="repeat each level three times",
    ),
    "single-runs": note(
        "one run a level: the scatter was taken from the levels' distance to the curve; trust the curve more than "
        "single levels, and repeat each level to tell scatter from a wrong curve"
    ),
    "repeat-is-off": caution(
        lambda v: (
            f"{v['symbol']} of {listed(v['runs'], 3)} is {v['off_pct']:+.0f} % off that of the other repeats, beyond "
            "their scatter: a filter, a sample rate or an instant of its input of its own? mend it, or leave it out"
        ),
        "off_pct",
        rank=1,
    ),
    "starts-apart": caution(
        "the runs of a level start apart, by a standard deviation of {ms:.3g} ms ({pct:.2g} % of τ1; {run} by "
        "{off_ms:+.3g} ms), as a trigger that jitters makes them: they are laid on each other; record input and output "
        "by one clock"
    ),
    "tails-taken-off": note(
        "steps begin on what the one before has left ({pct:.3g} % of the output {at}, where it is most): that is taken "
        "off as the plant tells it; rest longer between steps"
    ),
    "session-drifts": caution(
        lambda v: (
            f"the output drifts from run to run: {v['pct']:+.2g} % over the session (chance {v['chance']:.1g}), as a "
            "clutch that warms up; "
            + (
                "levels that were recorded one after another differ by it, and T_s(u) holds it: record them in random "
                "order, warmed up"
                if v["ordered"]
                else "the values are those of its middle: record it warmed up"
            )
        ),
        rank=0,
    ),
    "recorded-as-sweeps": caution(
        lambda v: (
            f"the repeats look like {v['sweeps']} sweeps: all levels of one share a shift of "
            f"{_joined(v['parameters'])}; the {v['runs']} runs count as {v['sweeps']} there, intervals are wider; "
            "record levels in random order instead"
        )
    ),
    "trend-not-estimable": note(
        "the levels do not tell the coefficients of the trend of {symbol} apart: use the curve"
    ),
    "runs-leave-the-share-open": note(
        "the runs leave C anywhere between {low:.2f} and {high:.2f}; every number rests on {held:g}, held"
    ),
    "runs-reject-the-share": caution(
        "the runs ask for C = {estimate:.3f} ({low:.3f} … {high:.3f}); it was held at {held:g}: T_s, τ1, τ2 and their "
        "intervals belong to the held C, not to the rig; a drift and a sensor that is slow or at its end look so too: "
        "if it is none of these, refit with «share» {estimate:.3f}",
        rank=0,
        refit="--share {estimate:.3f}",
        unless="tau2-outlasts-record",  # whose T_s would follow C far beyond what was reached
    ),
    "joint-fit-parts": note(
        lambda v: (
            f"the paper's joint fit parts from the model: {_parted(v)}; scatter of single runs' gain leads it astray"
        )
    ),
    "joint-fit-asked-for-parts": caution(
        lambda v: f"{_parted(v)}: scatter of single runs' gain leads the joint fit astray; leave out «estimator» joint"
    ),
    "output-decays-under-hold": caution(_decays, rank=-1),
    "rise-of-the-rig": caution(
        "the rise is the rig's: T_s differs by a factor of {times:.2g} between levels, the slope of the rise goes with "
        "T_s to the power {e:.2f} ({low:.2f} … {high:.2f}), where a τ of the plant's own makes it 1: τ1 and τ2 here "
        "are the loading of the stand; step the input on a stand that moves already",
        rank=-1,
        covers=("moves-with-step",),
        first="record steps on a stand that moves already",
    ),
    "polynomials-too-low": note(
        lambda v: (
            f"the levels lie further from the polynomial of {_joined(v['parameters'])} than their runs scatter: "
            + (
                f"at {v['worst']:g} {SYMBOLS[v['lag']]} of the curve is {v['off_pct']:+.2g} % off; each level's value "
                "is its own, controllers and replays run on the curve: fit the levels that you use alone"
                if v.get("lag")
                else "between the levels it is less sure than its interval says"
            )
            + "; «curve» levels takes T_s through each of them" * ("Ts" in v["parameters"])
        )
    ),
    "levels-exchanged": stop(
        "levels {low:g} and {high:g} look exchanged: T_s rises with the input, and follows a curve, if each has the "
        "other's name; name their logs right, or leave both out with «levels»"
    ),
    "levels-scatter": caution(
        lambda v: (
            f"{'' if v.get('parameter', 'Ts') == 'Ts' else SYMBOLS[v['parameter']] + ' of '}levels scatter by "
            f"{v['scatter_pct']:.2g} % about the curve, more than their logs leave open: {v['worst']:g} lies "
            + ("far" if v["off_pct"] is None else f"{v['off_pct']:+.2g} %")
            + (
                " off; no quadratic follows it: fit the levels that you use alone"
                if v.get("parameter", "Ts") != "Ts"
                else " off it; T_s(u) goes through them"
                if v.get("how")
                else " off; «curve» levels takes T_s through them"
                if v.get("by_curve")
                else " off; were they recorded on other days, or is T_s no cubic? «curve» levels takes it through them"
            )
        ),
        rank=1,
    ),
    "output-levels-off": caution(
        lambda v: (
            f"the output is the same {v['at']} (within {v['within_pct']:.2g} %): the clutch saturates there, or its "
            f"drive clips the input at {v['knee']:g} or before; "
            + (
                "T_s(u) goes through the levels' values"
                if v.get("how") == "levels"
                else f"inputs beyond {v['knee']:g} act as it does"
                if v.get("how") == "limit"
                else "no cubic T_s(u) follows it"
            )
            + f"; «{v['keeps']}» {v['least']:g}:{v['knee']:g} fits up to there"
        ),
        rank=0,
    ),
    "curve-misses-levels": caution(
        lambda v: (
            f"{v['at']} the model explains nothing (fit {v['fit_pct']:.2g} % at {v['worst']:g}): do not use it there; "
            + (
                "the table shows the levels' own values, and «curve» levels takes T_s through them"
                if v.get("repeats", True)
                else "with repeats of each level «curve» levels takes T_s through them"
            )
        ),
        rank=0,
    ),
    "filter-not-dead-time": caution(
        "the steps begin behind a dead time of {dead_time_s:.3g} s, and yet all repeats miss the curves alike, as "
        "behind a filter: τ1 and τ2 hold that, too, and their intervals do not know of it"
    ),
    "repeats-miss-alike": note(
        lambda v: (
            f"at {len(v['each'])} of {v['of']} levels all repeats miss the curve "
            f"alike (by {v['systematic']:.2g} at {v['worst']:g}): the shape is not quite right"
            + (
                ", and T_s, τ1, τ2 may be further off than their intervals tell; a ripple that comes at the same time "
                "of each run does so, too: start runs at other angles of the rotor"
                if v.get("far")
                else ""
            )
        )
    ),
    "draws-rejected": caution(
        "{pct:.0f} % of the draws broke a constraint (τ2 below τ1, or T_s below 0) and were drawn again: the ranges "
        "over the {plants} plants are cut there"
    ),
    # Logs fitted as recorded
    "input-faster-than-sampled": caution(
        "{subject}: the input jumps from row to row in {share_pct:.0f} % of the acting time: it moves faster than it "
        "is sampled, and what acted between the rows is not known; log it faster, or log its mean",
        "share_pct",
    ),
    "input-never-moves": caution(
        "{subject}: the input never moves (it stays at {level:g}): what is left of the state before it and the way to "
        "its steady value are one curve; record the step that leads there, from rest"
    ),
    "input-late": caution(
        lambda v: (
            f"{v['subject']}: the output moves "
            + (counted(int(v["rows"]), "row") if v["rows"] == int(v["rows"]) else f"{v['rows']:.2g} rows")
            + f" ({v['ms']:.3g} ms"
            + (f", {v['low']:.3g} … {v['high']:.3g}" if "low" in v else "")
            + ") before the input: the input was noted late, and the fit takes it as it acted; "
            + (
                "write what acts from a row on into that row"
                if v["rows"] == int(v["rows"])
                else "it changes between two rows, which a log of more rows would show"
            )
        ),
        "rows",
    ),
    "hold-out-fails": stop(
        lambda v: (
            f"the model explains {v['fit_pct']:.3g} % of what it was fitted to and {v['held_pct']:.3g} % of the "
            f"{v['what']} that a fit without them had not seen: it holds for these logs, not for the rig; look at the "
            "residuals, record more, or ask for a simpler model"
        )
    ),
    "drift-explains-as-much": stop(
        "what moves the output may be a drift: of what its own past does not foresee the input explains no more than "
        "chance does ({errors:.2g} errors off 0), whatever the fit's per cent; look at the columns, or move the input "
        "more, and faster than the output wanders"
    ),
    "residuals-follow-column": caution(
        "{share_pct:.2g} % of what the model leaves follows the column {column}, which was not read: a second input, "
        "which no model here has, or another reading of the output; record with it held still"
    ),
    "residuals-follow-input": caution(
        lambda v: f"what the model leaves is no noise: {v['share_pct']:.2g} % of it follows {FOLLOWED[v['by']]}"
    ),
    "no-kind-explains": stop(
        "no kind of lag explains these logs, the best {fit_pct:.2g} %: look at the columns, or whether the input "
        "drives the output at all"
    ),
    "kind-by-evidence": note(_say_kind, always=True),
    "dead-time": note(
        lambda v: (
            f"{v['subject']}: the output answers after a dead time of {v['dead_time_s']:.3g} s"
            + (f" ({v['low']:.3g} … {v['high']:.3g})" if "low" in v else "")
            + ", or its input is noted so early, or a filter delays it; the models begin behind it"
        ),
        "dead_time_s",
    ),
    "dead-time-within-row": caution(
        "the dead time of {dead_time_s:.2g} s is less than the {row_s:.2g} s from row to row: where the input is not "
        "switched just when a row is written, it may be up to {most_s:.2g} s, which margins do not count; log faster"
    ),
    "dead-time-grows": caution(
        "the dead time grows with the step, from {least_s:.3g} s at {least:g} to {most_s:.3g} s at {most:g}, as behind "
        "a drive that ramps its output, by some {rate:.3g} {unit} a second: the models have one dead time for all, and "
        "their τ1 takes the rest; record what the drive puts out as the input",
        rank=-1,
        covers=("other-shape-fits-better",),
        first="record what the drive puts out as the input",
    ),
    "torque-curve-by-evidence": note(
        "T_s follows no cubic of the input: it goes through its values at {values} inputs, which the logs tell"
    ),
    "range-goes-on": caution(
        "the logs' inputs go on to {high:g}, and beyond {wanted:g}, where «duty» ends, they move the output too: the "
        "range goes on; keep a controller below with «duty_limits»"
    ),
    "input-saturates": caution(
        "{subject}: the input stands at its limit ({limit:g}) for {share_pct:.0f} % of the acting time: it tells "
        "little there; lower the reference or the gains",
        "share_pct",
    ),
    "output-saturates": caution(
        "{subject}: the output stands at its largest value ({limit:.4g}) in {share_pct:.2g} % of the rows: the sensor "
        "or its amplifier ends there; these rows are left out, and what lies beyond is an extrapolation",
        "share_pct",
    ),
    "one-input-only": caution(
        "the logs excite one input only ({levels}): T_s, τ1 and τ2 are known there; how they go with the input is not"
    ),
    "idle-not-seen": caution(
        "{subject}: the log never rests, so its idle output is not known apart from T_s; 0 is taken: begin the log "
        "with a second at rest",
        first="begin the log with a second at rest",
    ),
    "rest-not-seen": caution(
        "{subject}: the log never rests: that T_s goes through rest in one curve is an assumption, from which the idle "
        "output follows; what is known is how it changes between the inputs: begin the log with a second at rest",
        first="begin the log with a second at rest",
    ),
    "input-leaves-tau-open": caution(
        lambda v: (
            f"these logs do not fix {v['symbol']} {v['at']}: its interval there is wider than "
            f"± {v['limit_pct']:g} %; hold these inputs {HOLD[v['parameter']]}"
        )
    ),
    "release-differs": note(
        "falls to rest have time constants of their own, {taus_s:.3g} s (the lowest input would give {edges_s:.3g} s; "
        "chance {chance:.2g}); they are fitted and taken for the release"
    ),
    "release-as-left": note(
        "falls to rest go with the time constants of the input that was left, not with one pair for all; loops and "
        "exported code, which hold no input, let go with those in the middle of the range"
    ),
    "release-own": note(
        "falls to rest have {taus_s:.3g} s of their own, next to {edges_s:.3g} s of the lowest input (chance "
        "{chance:.2g} that they are one), which they do not make surer"
    ),
    "release-alike": note(
        "falls to rest are as fast as the lowest input gives, {edges_s:.3g} s, as far as these logs can tell (chance "
        "{chance:.2g})"
    ),
    "release-not-seen": note(
        "the logs hold no fall to rest: that a release goes as at the lowest input is an assumption"
    ),
    "rise-not-seen": caution(
        "the logs hold falls of the input alone: that rises are as fast is an assumption; record steps from rest, too"
    ),
    "falls-differ": caution(_say_falls),
    "hysteresis": caution(
        "the steady output depends on where the input came from: {excess_pct:+.2g} % after a fall of the input "
        "(chance {chance:.2g}); T_s here is that after rises"
    ),
    "engagements-scatter": note(
        lambda v: (
            f"the output differs between engagements by {v['scatter_pct']:.2g} % (sd of {v['count']})"
            + ("; gains of their own are fitted beside the plant, whose T_s is that of their mean" * v["beside"])
            + "; the intervals of T_s hold it, "
            + (f"those of τ1 a scatter of {v['tau1_pct']:.2g} %" if v["tau1_pct"] else "those of τ1 no such scatter")
        )
    ),
    "engagements-few": note(
        "between rests the logs hold {count:#stretch} under load: how much the output differs from one to the next is "
        "not seen; let the recording return to rest four times or more"
    ),
    "duty-follows-output": caution(
        "{subject}: the input answers the noise of the output (correlation {correlation:.2f}): the log comes from a "
        "closed loop, and a direct fit is biased by as much as the noise"
    ),
    "loop-bias-unknown": caution(
        "{subject}: a closed loop whose law is not known: the bias of the direct fit cannot be told, and the intervals "
        "leave it out; name the reference of a PI loop with «columns» reference=NAME, or log it, or play an input of "
        "your own"
    ),
    "loop-direct": caution(
        "{subject}: its law is known, but the loop does not begin at rest, or the fit by its simulated input does not "
        "settle: the direct fit stands, whose bias the intervals leave out"
    ),
    "loop-instrument": note(
        "{subject}: fitted with the simulated input as an instrument: the noise that the input carries has no say"
    ),
}
