"""Sentences about replays."""

from eaid.findings.row import Row, Values, caution, note


def _leaves(v: Values) -> str:
    parts = []
    if v["below_pct"] > 1:
        parts.append(f"{v['below_pct']:.0f} % of the time below {v['low']:.4g} {v['unit']}")
    if v["above_pct"] > 1:
        parts.append(f"{v['above_pct']:.0f} % above {v['high']:.4g} {v['unit']}")
    if v["falling_pct"] is not None and v["falling_pct"] > 1:
        parts.append(f"{v['falling_pct']:.0f} % falling from level to level with the time constants of rising steps")
    return f"replays leave what was identified: {', '.join(parts)}; record steps down to levels there to know"


ROWS: dict[str, Row] = {
    "gains-not-identifiable": caution(
        "the gains were made from a fit that is not identifiable ({why}): the replay is marked"
    ),
    "plant-not-identifiable": caution(
        "the nonlinear model is not identifiable ({why}): the replay shows that model, not the clutch; it is marked"
    ),
    "reference-above-plant": caution(
        "the reference goes to {asked:.3g} {unit}, the plant at its highest input to {highest:.3g} {unit}"
    ),
    "reference-above-q-max": caution(
        "the reference is as steep as {slope:.3g} per second; the gains were made for Q_M = {Q_M:g}"
    ),
    "plants-all-alike": caution(
        "this fit holds no covariance of the nonlinear model, so every drawn plant is the fitted one; fit again with "
        "«ci» robust to carry the uncertainty on"
    ),
    "dead-time-replayed": note(
        "the duty acts {dead_time_s:.3g} s late, the dead time that the steps show; «delay_samples» says another"
    ),
    "no-gains": note("no «gains», so rc and pi are left out; the controllers that need none are replayed"),
    "open-loop-on-straight-line": note(
        "no linear model, so open-loop takes the straight line through the plant's steady torque"
    ),
    "replay-leaves-identified": note(_leaves),
}
