"""Sentences about uncertainty: what the data leave open, how the runs scatter, which estimate to believe."""

from collections.abc import Sequence

from eaid.findings.row import SYMBOLS, Row, Values, caution, note

CAUSES = {
    "one-exponential": "one exponential is all that most of them show",
    "short-record": "hold each level longer than {record_s:.3g} s",
    "records": "the records do not show it",
}


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
    known = f"{v['curve_half_width']:.1g} {v['output_unit']}".rstrip()
    return f"{v['at']} τ2 {said}; the curve itself is known to {known} within the record of {v['record_s']:.3g} s"


def _taus_meet(v: Values) -> str:
    taus = [f"{tau:g}" for tau in v["taus_s"]]
    listed = taus[0] if len(taus) == 1 else f"{', '.join(taus[:-1])} and {taus[-1]}"
    return (
        f"{v['at']} τ1 and τ2 meet, neither is estimable by itself: all that the records show is one exponential, of "
        f"{listed} s"
    )


def _together(v: Values) -> str:
    parts = ", ".join(f"{name} by {v[name]:+.0f} %" for name in ("p", "r1", "q", "r2") if name in v)
    return f"{v['symbol']}'s trend hardly changes when {parts} change together: only the curve is known"


def _open_at_most(v: Values) -> str:
    why = CAUSES[v["cause"]].format(**v)
    return f"{v['symbol']} is not determined at {v['count']} of {v['of']} levels: {why}"


def _scatter_changes(v: Values) -> str:
    last, first = (f"{u:.4g}" for u in v["each"])
    here = f"up to {last} than above" if v["ratio"] > 1 else f"from {first} on than below"
    return (
        f"the runs' scatter of {v['symbol']} is {max(v['ratio'], 1 / v['ratio']):.2g} times larger {here}: "
        "the intervals follow it; more repeats there would narrow them most"
    )


def _convention(v: Values) -> str:
    pooled = "" if v["several"] else ", and so does the pooled one"
    return f"one level's step gives b0 u + c0 only; its b0 rests on the convention that c0 is 0{pooled}"


def _share(v: Values) -> str:
    apart = ", the levels not all the same" if v["differ"] else ""
    return f"the runs ask for C = {v['estimate']:.3f} ({v['low']:.3f} … {v['high']:.3f}){apart}"


def _parted(v: Values) -> str:
    ends = f" [{v['low']:.3g}, {v['high']:.3g}]" if v["low"] is not None else ", where a constraint holds it"
    return f"{v['symbol']} at {v['worst']:g}: joint {v['joint']:.3g}, two-stage {v['two_stage']:.3g}{ends}"


def _scattered(v: Values) -> str:
    return f"runs of one level differ by {v['gain_pct']:.2g} % in T_s, and " if v["gain_pct"] > 0.2 else ""


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


def _fits(v: Values) -> str:
    closer = v.get("closer_pct")
    if closer is None:
        return f"keep {v['usual']}"
    return f"keep {v['usual']}: a free C fits {f'only {closer:.0f} %' if closer >= 0.5 else 'no'} closer"


def _orders(v: Values) -> str:
    asked = ", ".join(f"order {v[name]} for {SYMBOLS[name]}" for name in ("Ts", "tau1", "tau2") if name in v)
    return f"the levels ask for {asked} instead of the paper's polynomials"


ROWS: dict[str, Row] = {
    "numbers-beyond-measure": caution(
        lambda v: (
            f"some numbers are beyond any measure and are left out ({', '.join(v['keys'])}): the data do not tell them"
        )
    ),
    "taus-meet": caution(_taus_meet),
    "parameter-constrained": caution("{at} {symbol} is not estimable: a constraint holds it"),
    "tau2-open": caution(_tau2_open),
    "tau2-outlasts-record": caution("{at} τ2 is longer than the record of {record_s:.3g} s; record longer"),
    "no-level-determines-all": caution("no level determines all of T_s, τ1 and τ2", rank=1),
    "free-share-open": caution(
        "{at} the free C is anywhere between {low:.2f} and {high:.2f}: C and τ2 trade against each other; hold C"
    ),
    "coefficients-together": note(_together),
    "one-level-nonlinear": caution(
        "one level only: nothing says how T_s, τ1 and τ2 change with the duty; record more levels",
        rank=1,
        covers=("one-level-linear", "b0-by-convention"),
    ),
    "few-levels-for-polynomials": caution(
        "{count:#level} pin the polynomials of T_s, τ1, τ2 exactly or not at all: nothing checks their shape"
    ),
    "parameter-open-at-most-levels": caution(_open_at_most, rank=1, covers=("no-level-determines-all",)),
    "share-free": caution(
        "C is free ({C:.3g}): it trades against τ2 wherever the record is not several τ2 long, and T_s and τ2 are less "
        "sure for it; hold C unless the data ask for another"
    ),
    "one-level-linear": caution(
        "one level only: one step cannot tell b0 from c0, only b0 u + c0 is known; record a second level", rank=1
    ),
    "a0-may-be-zero": caution(
        "a0 may be zero (95 % interval {low:.3g} to {high:.3g} 1/s): the records are too short", rank=1
    ),
    "b0-may-be-zero": caution(
        "b0 may be zero or negative (95 % interval {low:.3g} to {high:.3g}): the duty's effect is not seen", rank=1
    ),
    "no-b-bounds": caution("no level has a positive b0, so B has no bounds", rank=1),
    "b0-by-convention": note(_convention),
    "single-runs-few-levels": caution(
        "one run a level and too few levels to see run-to-run scatter: the intervals hold one run's own noise only and "
        "are too narrow; repeat each level three times"
    ),
    "single-runs": note(
        "one run a level: the scatter was taken from the levels' distance to the curve; trust the curve more than "
        "single levels, and repeat each level to tell scatter from a wrong curve"
    ),
    "recorded-as-sweeps": caution(
        lambda v: (
            f"the repeats look like {v['sweeps']} sweeps: all levels of one share a shift of "
            f"{_joined(v['parameters'])}; the {v['runs']} runs count as {v['sweeps']} there, intervals are wider; "
            "record levels in random order instead"
        )
    ),
    "scatter-changes": note(_scatter_changes),
    "no-intervals-at-all": caution(
        "no intervals: these data do not determine the curves well enough to compute any ({fault})"
    ),
    "trend-not-estimable": note("the trend of {symbol} is at a limit: its coefficients are not estimable"),
    "trend-uses-all-levels": note(
        "the trend of {symbol} has as many coefficients as levels: nothing is left to tell how sure they are"
    ),
    "trend-coefficients-alike": note(
        "the coefficients of the trend of {symbol} cannot be told apart: only the curve itself is known"
    ),
    "trend-coefficients-vague": note(
        "some coefficients of the trend of {symbol} are not told apart from zero or from each other: use the curve"
    ),
    "runs-give-no-share": note(
        "the runs give no C of their own: every number rests on the C of {held:g} that was held"
    ),
    "runs-leave-the-share-open": note(
        "the runs leave C anywhere between {low:.2f} and {high:.2f}; every number rests on {held:g}, held"
    ),
    "runs-reject-the-share": caution(
        lambda v: (
            f"{_share(v)}; it was held at {v['held']:g}: T_s, τ1, τ2 and their intervals belong to the held C, not to "
            f"the rig; refit with «share» {v['estimate']:.3f}"
        )
    ),
    "two-stage-estimate-taken": note(
        lambda v: (
            f"the two-stage estimate stands as the nonlinear model: {_parted(v)}; {_scattered(v)}the joint fit makes "
            "up for a level's output with the time constants of its neighbours"
        )
    ),
    "two-stage-estimate-is-better": caution(
        lambda v: (
            f"{_parted(v)}: believe the two-stage estimate («estimator» two-stage); {_scattered(v)}the joint fit makes "
            "up for a level's output with the time constants of its neighbours"
        )
    ),
    "estimates-part-and-neither-holds": caution(
        lambda v: (
            f"{_parted(v)}: believe neither; too few levels determine "
            f"{_joined(v['weak'])} on their own, and the joint fit makes up values there"
        )
    ),
    "no-two-stage-estimate": caution(
        "no two-stage estimate: no level alone determines all of its parameters; the joint fit stands"
    ),
    "two-stage-held": caution("a constraint holds {symbol} of the two-stage estimate"),
    "output-decays-under-hold": caution(_decays, rank=0, covers=("decays-under-hold",)),
    "shape-fits": note(_fits),
    "shape-of-another-kind": note("use {shape}: RMSE {rmse:.3g} against {usual_rmse:.3g} of {usual}"),
    "no-shape-fits": caution(
        "none of the shapes tried: even the closest, {shape}, is missed alike by all repeats at {count} of {of} levels"
    ),
    "shape-needs-the-share": note(
        "use two exponentials, C = {estimate:.3f} at all levels: the runs reject C = {held:g}; fit again with «share» "
        "{estimate:.3f} before judging the polynomials"
    ),
    "polynomials-fit": note("the paper's polynomials follow the levels as well as any of orders 1 to 4"),
    "polynomials-too-low": note(_orders),
    "repeats-miss-alike": note(
        lambda v: (
            f"at {len(v['each'])} of {v['of']} levels all repeats miss the curve "
            f"alike (by {v['systematic']:.2g} at {v['worst']:g}): the shape is not quite right"
        )
    ),
    "draws-rejected": caution(
        "{pct:.0f} % of the draws broke a constraint (τ2 below τ1, or T_s below 0) and were drawn again: the ranges "
        "over the {plants} plants are cut there"
    ),
}
