"""Sentences about virtual walls."""

from eaid.findings.row import Row, caution, note

ROWS: dict[str, Row] = {
    "wall-beyond-stable": caution(
        "{subject}: a wall of {wanted:.3g} N·m/rad is beyond what stays stable at {torque_nm:.3g} {unit} on this limb "
        "({stable:.3g} N·m/rad); render a softer one, or with another loop",
        size="wanted",
    ),
    "wall-not-passive": note(
        "{subject} renders {passive:.3g} N·m/rad passively at {torque_nm:.3g} {unit}; between that and "
        "{stable:.3g} N·m/rad only this limb keeps it stable",
        size="stable",
    ),
    "wall-by-rate": note(
        "rc with its reference rate: {stable:.3g} N·m/rad at {torque_nm:.3g} {unit} rests on fractions of a sample; "
        "without the rate it is {without:.3g}",
        size="stable",
    ),
    "clutch-cannot-turn": caution(
        "the limb may move faster than the rotor by {short:.3g} rad/s: there the clutch's torque turns round; a rotor "
        "of {needed_rpm:.3g} RPM does not let it"
    ),
    "wall-beyond-encoder": caution(
        "{subject}: walls above {encoder:.3g} N·m/rad chatter on the encoder's steps, idle drag {drag:.3g} {unit}"
    ),
    "pair-bias-cut": note("the pair's bias of {bias:.3g} {unit} leaves {torques} {unit} to the single clutch only"),
}
