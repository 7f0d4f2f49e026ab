"""Sentences about uncertainty: what the data leave open, how the runs scatter, which estimate to believe."""

from collections.abc import Callable, Mapping
from typing import Any

from eaid.findings.row import Row

Values = Mapping[str, Any]
SYMBOLS = {"Ts": "T_s", "tau1": "τ1", "tau2": "τ2", "C": "C", "C_f": "C_f"}
CAUSES = {
    "one-exponential": "one exponential is all that most of them show",
    "short-record": "hold each level longer than {record_s:.3g} s",
    "records": "the records do not show it",
}


def _at(v: Values) -> str:
    return f"at {v['levels']} {v.get('unit') or ''}".rstrip()


def _named(text: str) -> Callable[[Values], str]:
    """A template whose `{parameter}` is the symbol."""
    return lambda v: text.format(**{**v, "parameter": SYMBOLS[v["parameter"]], "at": _at(v)})


def _joined(names: Any) -> str:
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
    return f"{_at(v)} τ2 {said}; the curve itself is known to {known} within the record of {v['record_s']:.3g} s"


def _taus_meet(v: Values) -> str:
    taus = [f"{tau:g}" for tau in v["taus_s"]]
    listed = taus[0] if len(taus) == 1 else f"{', '.join(taus[:-1])} and {taus[-1]}"
    return (
        f"{_at(v)} τ1 and τ2 meet, neither is estimable by itself: all that the records show is one exponential, of "
        f"{listed} s"
    )


def _together(v: Values) -> str:
    parts = ", ".join(f"{name} by {v[name]:+.0f} %" for name in ("p", "r1", "q", "r2") if name in v)
    trend = SYMBOLS[v["parameter"]]
    return f"{trend}'s trend hardly changes when {parts} change together: only the curve is known"


def _open_at_most(v: Values) -> str:
    why = CAUSES[v["cause"]].format(**v)
    return f"{SYMBOLS[v['parameter']]} is not determined at {v['count']} of {v['of']} levels: {why}"


def _constraints(v: Values) -> str:
    held = v["constraints"]
    more = f" and {len(held) - 4} more" if len(held) > 4 else ""
    return f"a constraint holds {', '.join(held[:4])}{more}: not estimable there"


def _scatter_changes(v: Values) -> str:
    last, first = v["levels"].split(" and ")
    here = f"up to {last} than above" if v["ratio"] > 1 else f"from {first} on than below"
    return (
        f"the runs' scatter of {SYMBOLS[v['parameter']]} is {max(v['ratio'], 1 / v['ratio']):.2g} times larger {here}: "
        "the intervals follow it; more repeats there would narrow them most"
    )


def _convention(v: Values) -> str:
    pooled = "" if v["several"] else ", and so does the pooled one"
    return f"one level's step gives b0 u + c0 only; its b0 rests on the convention {v['convention']}{pooled}"


ROWS: dict[str, Row] = {
    "taus-meet": Row("caution", _taus_meet),
    "parameter-constrained": Row("caution", _named("{at} {parameter} is not estimable: a constraint holds it")),
    "tau2-open": Row("caution", _tau2_open),
    "tau2-outlasts-record": Row(
        "caution", lambda v: f"{_at(v)} τ2 is longer than the record of {v['record_s']:.3g} s; record longer"
    ),
    "no-level-determines-all": Row("caution", "no level determines all of T_s, τ1 and τ2"),
    "free-share-open": Row(
        "caution",
        lambda v: (
            f"{_at(v)} the free C is anywhere between {v['low']:.2f} and {v['high']:.2f}: C and τ2 trade against each "
            "other; hold C"
        ),
    ),
    "rates-merged": Row(
        "note",
        _named(
            "the two rates of {parameter}'s trend cannot be told apart: only their limit (p + q x) e^(r x) is known"
        ),
    ),
    "coefficients-together": Row("note", _together),
    "one-level-nonlinear": Row(
        "caution", "one level only: nothing says how T_s, τ1 and τ2 change with the duty; record more levels"
    ),
    "few-levels-for-polynomials": Row(
        "caution", "{count} levels pin the polynomials of T_s, τ1, τ2 exactly or not at all: nothing checks their shape"
    ),
    "parameter-open-at-most-levels": Row("caution", _open_at_most),
    "constraints-hold": Row("caution", _constraints),
    "share-free": Row(
        "caution",
        "C is free ({C:.3g}): it trades against τ2 wherever the record is not several τ2 long, and T_s and τ2 are less "
        "sure for it; hold C unless the data ask for another",
    ),
    "one-level-linear": Row(
        "caution", "one level only: one step cannot tell b0 from c0, only b0 u + c0 is known; record a second level"
    ),
    "a0-may-be-zero": Row(
        "caution", "a0 may be zero (95 % interval {low:.3g} to {high:.3g} 1/s): the records are too short"
    ),
    "b0-may-be-zero": Row(
        "caution",
        "b0 may be zero or negative (95 % interval {low:.3g} to {high:.3g}): the duty's effect is not seen",
    ),
    "no-B": Row("caution", "no level has a positive b0, so B has no bounds"),
    "b0-by-convention": Row("note", _convention),
    "single-runs-few-levels": Row(
        "caution",
        "one run a level and too few levels to see run-to-run scatter: the intervals hold one run's own noise only and "
        "are too narrow; repeat each level three times",
    ),
    "single-runs": Row(
        "note",
        "one run a level: the scatter was taken from the levels' distance to the curve; trust the curve more than "
        "single levels, and repeat each level to tell scatter from a wrong curve",
    ),
    "recorded-as-sweeps": Row(
        "caution",
        lambda v: (
            f"the repeats look like {v['sweeps']} sweeps: all levels of one share a shift of "
            f"{_joined(v['parameters'])}; the {v['runs']} runs count as {v['sweeps']} there, intervals are wider; "
            "record levels in random order instead"
        ),
    ),
    "scatter-changes": Row("note", _scatter_changes),
}
