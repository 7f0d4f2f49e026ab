"""docs/robust-control.md: its numbers come from these runs."""

import re
from pathlib import Path

import numpy as np
import pytest

from eaid.control.bounds import Bounds
from eaid.control.design import shown_by_model
from eaid.control.gains import paper_gains
from eaid.control.margins import RIG, margins, pi_feedback, rc_feedback
from eaid.control.operating import operating_points
from eaid.control.options import DesignOptions
from eaid.control.pi import pi_gains, step_metrics
from eaid.control.rc_design import law_of
from eaid.control.robust import equal_pi
from eaid.models.parameters import PAPER_LINEAR, REFERENCE_PLANT, Linear
from eaid.replay import references
from eaid.replay.controllers import pi_controller, rc_controller
from eaid.replay.loop import replay
from eaid.replay.plant import plant_parameters
from eaid.replay.references import measure, replayed
from eaid.replay.rig import Rig
from eaid.results.fit import Fit

TEXT = re.sub(r"\s+", " ", (Path(__file__).parents[2] / "docs/robust-control.md").read_text(encoding="utf-8"))
BOUNDS = Bounds((), 12.4, 42.6, ())
POINTS = operating_points(Fit(), PAPER_LINEAR, REFERENCE_PLANT, BOUNDS)
MULTISINE = references.multisine(1e-3, 12.0)
THREE_HZ = references.sweep(1e-3, frequencies_hz=(3.0,))
RC, PI = paper_gains()
SLOPES = equal_pi(4.5, 3.0, 12.5, RC.rho_constant, 0.5, RC.Q12, RC.Q22)
# No robust term, and K_P, K_D that give the slopes it has inside the layer: the PI with RC's own feedforward.
LIKE_RC = RC._replace(rho_constant=0.0, rho_slope=0.0, K_D=SLOPES[0] / 12.5, K_P=SLOPES[1] / 12.5)
MEETS = pi_gains(PAPER_LINEAR, 1.0, 0.27)
ROWS = {
    "RC, Table IV": rc_controller(RC),
    "the paper's PI, 21 and 360": pi_controller(PI),
    "the PI that meets the specification, 156.6 and 252.9": pi_controller(PI._replace(K_P=MEETS[0], K_I=MEETS[1])),
    "the PI of equal slope inside the layer, 313 and 206, with RC's feedforward": rc_controller(LIKE_RC),
    "the same PI without feedforward": pi_controller(PI._replace(K_P=SLOPES[0], K_I=SLOPES[1])),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ROWS)
def test_row_of_the_comparison(name):
    controller = ROWS[name]
    quiet = replayed(REFERENCE_PLANT, controller, MULTISINE)
    noisy = replayed(REFERENCE_PLANT, controller, MULTISINE, Rig(noise_nm=0.01))
    tone = replay(plant_parameters(REFERENCE_PLANT), controller, THREE_HZ.torque_nm, Rig(), 1e-3, 0)
    gain = measure(tone, THREE_HZ).frequencies[0].gain_db
    found = [
        margins(
            rc_feedback(controller.gains, torque, duty) if controller.name == "rc" else pi_feedback(controller.gains),
            lags, RIG,
        )
        for duty, torque, lags in POINTS
    ]  # fmt: skip
    row = (
        f"| {name} | {quiet.max_abs_error_nm:.3f} N·m | {quiet.rms_error_nm:.4f} N·m "
        f"| {noisy.mean_abs_duty_step_pct:.2f} % | {gain:.1f} dB | {min(m.gain_db for m in found):.1f} dB "
        f"| {min(m.phase_deg for m in found):.1f}° |"
    )
    assert row.replace("-", "−") in TEXT.replace("-", "−")


def test_shares_in_words():
    errors = {name: replayed(REFERENCE_PLANT, row, MULTISINE).max_abs_error_nm for name, row in ROWS.items()}
    rc, paper, meets, alike, bare = errors.values()
    assert f"{100 * (1 - rc / paper):.0f}" == "85" and "85 % less" in TEXT
    assert f"{100 * (1 - rc / meets):.0f}" == "68" and "RC is 68 % better" in TEXT
    assert f"{100 * (1 - rc / alike):.0f}" == "3" and "RC is 3 % better in both errors" in TEXT
    assert 1.7 < bare / alike < 2.3
    found = step_metrics(PAPER_LINEAR, 21.0, 360.0)
    assert f"{found.overshoot_pct:.1f} % overshoot and {found.settling_s:.2f} s" in TEXT


@pytest.mark.slow
def test_noise_over_seeds():
    plant = plant_parameters(REFERENCE_PLANT)
    told = []
    for name in list(ROWS)[:2]:
        runs = [replay(plant, ROWS[name], MULTISINE.torque_nm, Rig(noise_nm=0.01), 1e-3, seed) for seed in range(20)]
        true = np.mean([np.abs((run.reference_nm - run.torque_nm)[5000:]).max() for run in runs])
        seen = np.mean([np.abs(run.measured_nm - run.reference_nm)[5000:].max() for run in runs])
        told.append((true, seen))
    (rc, rc_seen), (pi, pi_seen) = told
    assert f"{rc:.3f} N·m against {pi:.3f} N·m over twenty seeds" in TEXT
    assert f"is {rc_seen:.3f} and {pi_seen:.3f} N·m" in TEXT


@pytest.mark.parametrize(
    ("start", "options"),
    [
        ("pooled, 1/b0 (the paper's)", DesignOptions()),
        ("pooled, ρ made with the α reached (`--alpha reached`)", DesignOptions(alpha="reached")),
        ("minimax, 2 B_m B_M/(B_m + B_M)", DesignOptions(B_hat="minimax")),
    ],
)
def test_row_of_B_hat(start, options):
    law = law_of(PAPER_LINEAR, BOUNDS, options)
    worst = replayed(REFERENCE_PLANT, rc_controller(law.gains), MULTISINE).max_abs_error_nm
    row = (
        f"| {start} | {law.gains.B_hat:.1f} | {law.alpha:.4f} | {law.alpha_reached:.4f} "
        f"| {'yes' if law.guaranteed else 'no'} | {law.ultimate_bound_nm():.3g} N·m | {worst:.3f} N·m |"
    )
    assert row in TEXT


def test_readings():
    for reading, constant in (("paper", "10.8125"), ("textbook", "6.09765")):
        law = law_of(PAPER_LINEAR, BOUNDS, DesignOptions(reading=reading))
        assert f"{law.rho.constant:.6g}" == constant
        assert f"{constant} + {law.rho.slope:.6g} ‖ξ‖" in TEXT
        assert f"{law.phi_honest_pct:.3g} % duty" in TEXT


def test_mismatch_and_slope():
    published = shown_by_model(REFERENCE_PLANT, PAPER_LINEAR, 12.4, 42.6)
    fitted = shown_by_model(REFERENCE_PLANT, Linear(1.84393, 0.0782825, -1.343124), 8.349, 41.142)
    assert f"{published.pct:.1f} % duty" in TEXT and f"{fitted.pct:.1f} % for the model" in TEXT
    assert f"{0.05 * 12.4 * 42.6:.1f} % and {0.05 * 8.349 * 41.142:.1f} %" in TEXT
    assert f"{MULTISINE.steepest_nm_s:.2f} N·m/s" in TEXT


def test_what_another_B_hat_leaves():
    """The error with less duty for a slope, and the α that the guarantee would need."""
    law = law_of(PAPER_LINEAR, BOUNDS, DesignOptions(B_hat=8.16))
    rig = Rig(noise_nm=0.01)
    papers, done = (
        replayed(REFERENCE_PLANT, rc_controller(gains), MULTISINE, rig).rms_error_nm for gains in (RC, law.gains)
    )
    assert f"stays at {papers:.4f} N·m" in TEXT
    assert f"`--b-hat 8.16` leaves {done:.4f} N·m, {100 * (1 - done / papers):.0f} % less" in TEXT
    assert f"α reached of {law.alpha_reached:.3f}" in TEXT
