"""Sentences about plans: what a plan assumes, and where it falls short of what was wanted."""

from eaid.findings.row import Row, Values, caution


def _falls_short(v: Values) -> str:
    if v["width_pct"] is None:
        return f"{v['symbol']} stays undetermined with all that is allowed: a longer «longest_hold» is needed"
    cause = (
        f"runs differ by {v['scatter_pct']:.2g} %, and {v['repeats']} repeats only average that"
        if v["scatter_pct"] is not None
        else "a longer «longest_hold» or a quieter sensor is needed"
    )
    return (
        f"{v['symbol']} comes to {v['width_pct']:.3g} %, not {v['wanted_pct']:g} %, with all that is allowed: {cause}"
    )


ROWS: dict[str, Row] = {
    "plan-assumes-noise": caution(
        "the fit does not say how noisy the rig is; assumed: 3 % scatter of T_s, 5 % of τ1 from run to run, 1 % ripple "
        "and 0.03 N·m of sensor noise at 1 kHz; fit again to use the rig's own"
    ),
    "plan-of-decaying-output": caution(
        "the output decays under hold at {levels}: a plan for rising exponentials cannot mend that"
    ),
    "plan-rests-on-a-guess": caution(
        "the fit itself is not identifiable: the plan rests on a guess; record a few levels by it, fit, and plan again"
    ),
    "plan-falls-short": caution(_falls_short),
}
