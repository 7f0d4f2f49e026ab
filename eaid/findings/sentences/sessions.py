"""Sentences about sessions, several mountings of one rig, and about plans of the next."""

from eaid.errors import on_command_line
from eaid.findings.row import NUMBER_NAMES, Row, Values, caution, note
from eaid.findings.sentences.fitting import kind_in_words


def _no_scatter(v: Values) -> str:
    parts = " and ".join(v["components"])
    return f"the sessions show no scatter of {v['symbol']} in {parts}: few of them may have hidden it"


def _one_of_several(v: Values) -> str:
    parts = "; ".join(v["parts"])
    commands = [
        f"eaid fit {logs} {v['options']}".rstrip() + f" -o {k}.json" for k, logs in enumerate(v.get("logs", ()), 1)
    ]
    offer = f"; part them: {on_command_line('; '.join(commands))}" if commands else "; fit each by itself"
    mixed = ", and what differs between their levels may be the sessions" if v["mixed"] else ""
    return f"the logs hold {v['sessions']} sessions ({v['by']}: {parts}){mixed}{offer}"


def _kept(v: Values) -> str:
    *others, last = (NUMBER_NAMES.get(one, one) for one in v["parameters"])
    names = f"{', '.join(others)} and {last}" if others else last
    return f"fewer than three sessions determine {names}: as in the session with the most levels"


def _falls_short(v: Values) -> str:
    if v["width_pct"] is None:
        return f"{v['symbol']} stays undetermined with all that is allowed: a longer «longest_hold» is needed"
    cause = (
        f"runs differ by {v['scatter_pct']:.2g} %, and {v['repeats']} repeats only average that"
        if v["scatter_pct"] is not None
        else "a longer «longest_hold» or a quieter sensor is needed"
    )
    width = next(said for digits in range(3, 10) if (said := f"{v['width_pct']:.{digits}g}") != f"{v['wanted_pct']:g}")
    return f"{v['symbol']} comes to {width} %, not {v['wanted_pct']:g} %, with all that is allowed: {cause}"


ROWS: dict[str, Row] = {
    "few-sessions": caution(
        "{sessions} sessions: how much they differ is known to a factor only; record five and more"
    ),
    "session-not-usable": caution(
        "session {subject} is of a fit that is NOT USABLE ({why}): its values are taken as they are; fit it again"
    ),
    "no-scatter-in-parts": caution(_no_scatter),
    "reference-level-outside": caution(
        "the reference level {level:.4g} {unit} lies outside the levels {levels} of the sessions: what is said there "
        "is carried on from them; choose one among them"
    ),
    "session-carries-estimate": caution(
        "session {session} carries the estimate: without it the next one's {symbol} is within ×/÷ {factor:.3g}, with "
        "it ×/÷ {whole:.3g}; look at what was special about it"
    ),
    "trend-over-sessions": caution(
        "{symbol} changes by {pct:+.2g} % from each session to the next (p {p:.2g}): a trend, as of wear, which the "
        "next session's interval does not carry on"
    ),
    "levels-and-sessions-confounded": caution(
        "levels and sessions are confounded: the sessions {at} share no level with the others, so what differs between "
        "levels may be the sessions, and a reference step tells nothing of levels that share no session with its own; "
        "record a level of the others in each session"
    ),
    "several-sessions": caution(_one_of_several, always=True, rank=1, first="fit each session by itself"),
    "session-assumes-scatter": caution(
        "session {subject} has too few runs, or engagements, to show how these scatter: 3 % of T_s and 5 % of τ are "
        "assumed, and a shift of a few times as much may be chance; repeat each level"
    ),
    "kind-moved": caution(
        lambda v: (
            f"{v['subject']}: the plant is {kind_in_words(v['a'])}, for {kind_in_words(v['b'])}: loops that were made "
            "for the other are not made for this, whatever T_s says"
        ),
        rank=-1,
    ),
    "plant-moved": caution(
        "{subject}: {what} {a:.3g}{unit} for {b:.3g}{unit}, which T_s of no level tells: loops that were made for the "
        "other are not made for this",
        rank=-1,
    ),
    "for-this-mounting": note(
        lambda v: (
            f"of one session: {v.get('what', 'gains, guarantee and margins')} hold for this mounting; fits of three "
            "and more, held together by `eaid sessions`, tell what holds for the next"
        )
    ),
    "for-today": note(
        "T_s within ×/÷ {factor:.3g} at the worst level, without the steps ×/÷ {without:.3g} (by {sessions} sessions "
        "and {steps:#reference step})"
    ),
    "steps-tell-alone": note(
        "of other levels the steps tell next to nothing: by these sessions no gain differs that all levels share"
    ),
    "step-foreseen": note(
        "the reference step at {levels} {unit_in} shows T_s {value:.3g} {unit}; foreseen was {middle:.3g} ({low:.3g} … "
        "{high:.3g}), {pct:+.3g} %"
    ),
    "kept-from-base": note(_kept),
    "step-outside": caution(
        "the reference step at {levels} {unit_in} shows T_s {value:.3g} {unit}; foreseen was {middle:.3g} ({low:.3g} … "
        "{high:.3g}), {pct:+.3g} %: record it again, or this mounting is another rig"
    ),
    # Plans
    "plan-assumes-noise": caution(
        "the fit does not say how noisy the rig is; assumed: 3 % scatter of T_s, 5 % of τ1 from run to run, 1 % ripple "
        "and 0.03 N·m of sensor noise at 1 kHz; fit again to use the rig's own"
    ),
    "plan-assumes-scatter": caution(
        "the fit holds too few engagements to show how runs scatter; assumed, as usual: 3 % of T_s and 5 % of τ1 from "
        "run to run"
    ),
    "plan-of-decaying-output": caution(
        "the output decays under hold at {levels}, which no plan mends: τ2 means nothing there, repeats only average"
    ),
    "plan-rests-on-a-guess": caution(
        "the fit itself is not identifiable: the plan rests on a guess; record a few levels by it, fit, and plan again"
    ),
    "plan-falls-short": caution(_falls_short),
    "excitation-short": caution(
        lambda v: (
            f"no sequence of {v['most_s']:g} s within the limits reaches the widths: {v['parameter']} "
            + ("stays undetermined" if v["width_pct"] is None else f"comes to ± {v['width_pct']:.3g} %")
            + f", not {v['wanted_pct']:g} %"
        )
    ),
}
