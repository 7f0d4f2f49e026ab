"""docs/robust-control.md: its numbers come from these runs."""

import re
from pathlib import Path

import numpy as np
import pytest

import eaid

TEXT = re.sub(r"\s+", " ", (Path(__file__).parents[2] / "docs/robust-control.md").read_text(encoding="utf-8"))
ALIKE = "the PI of equal slope inside the layer, 313 and 206, with RC's feedforward"
MEETS = "the PI that meets the specification, 156.6 and 252.9"
PAPER = "the paper's PI, 21 and 360"
BARE = "the PI of the same margins without it, 296 and 206"


@pytest.fixture(scope="module")
def fit(fit_of):
    return fit_of(nonlinear=True)


@pytest.fixture(scope="module")
def rows(fit, fit_of):
    """Name → fit, gains and the controller among them."""
    paper = eaid.tune_rc(fit, pi_gains=(21.0, 360.0))
    slopes = paper.rc.equal_pi
    # No robust term, and K_P, K_D that give the slopes it has inside the layer: the PI with RC's own feedforward.
    alone = fit_of(nonlinear=True, linear={"bounds": {"B_m": 12.5, "B_M": 12.5}})
    like = eaid.tune_rc(alone, kp=slopes.K_I / 12.5, kd=slopes.K_P / 12.5, q_max=0.0, phi=0.0)
    assert like.rc.rho.constant == like.rc.rho.slope == 0.0
    return {
        "RC, Table IV": (paper, "rc"),
        PAPER: (paper, "pi"),
        MEETS: (eaid.tune_rc(fit), "pi"),
        ALIKE: (like, "rc"),
        BARE: (eaid.tune_rc(fit, pi_gains=(slopes.K_P - 17.0, slopes.K_I)), "pi"),  # a0/b0 = 17: the feedforward's
    }


def replayed(fit, row, scenario="multisine", **options):
    gains, law = row
    return eaid.simulate(fit, gains, scenario, controller=(law,), **options).records[law]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["RC, Table IV", PAPER, MEETS, ALIKE, BARE])
def test_row_of_the_comparison(fit, rows, name, tmp_path):
    gains, law = rows[name]
    quiet, noisy = replayed(fit, rows[name]).metrics, replayed(fit, rows[name], noise_nm=0.01).metrics
    least = gains.margins.worst[law]
    t = np.arange(15_001) * 1e-3
    wave = np.sin(6 * np.pi * t)
    np.savetxt(tmp_path / "3Hz.csv", np.c_[t, 2 + wave], "%.15g", ",", header="time_s,reference_nm", comments="")
    done = replayed(fit, rows[name], None, reference=tmp_path / "3Hz.csv").columns["torque_nm"][10_000:15_000]
    parts = np.c_[wave, np.cos(6 * np.pi * t), np.ones(len(t))][10_000:15_000]
    three = 20 * np.log10(np.hypot(*np.linalg.lstsq(parts, done)[0][:2]))
    row = (
        f"| {name} | {quiet.max_abs_error_nm:.3f} N·m | {quiet.rms_error_nm:.4f} N·m "
        f"| {noisy.mean_abs_duty_step_pct:.2f} % | {three:.1f} dB | {least.gain_db:.1f} dB "
        f"| {least.phase_deg:.1f}° |"
    )
    assert row.replace("-", "−") in TEXT.replace("-", "−")


@pytest.mark.slow
def test_shares_in_words(fit, rows):
    rc, paper, meets, alike, bare = (replayed(fit, row).metrics.max_abs_error_nm for row in rows.values())
    assert (f"{rc:.3f}", f"{paper:.3f}") == ("0.116", "0.797")  # specification 6
    assert f"{100 * (1 - rc / paper):.0f}" == "85" and "85 % less" in TEXT
    assert f"{100 * (1 - rc / meets):.0f}" == "68" and "RC is 68 % better" in TEXT
    assert f"{100 * (1 - rc / alike):.0f}" == "3" and "RC is 3 % better in both errors" in TEXT
    assert 1.7 < bare / alike < 2.3
    compared = rows[MEETS][0].replayed
    assert compared.equal_pi.max_abs_error_nm == pytest.approx(bare, rel=1e-6)
    assert compared.equal_pi_feedforward.max_abs_error_nm == pytest.approx(alike, rel=1e-6)
    assert f"At equal margins a PI leaves {bare / rc:.1f} times RC's largest error" in TEXT
    pi = rows[PAPER][0].pi
    assert f"{pi.overshoot_pct:.1f} % overshoot and {pi.settling_s:.2f} s" in TEXT


@pytest.mark.slow
def test_noise_over_seeds(fit, rows):
    def largest(name):
        runs = [replayed(fit, rows[name], noise_nm=0.01, seed=seed).columns for seed in range(20)]
        seen = ("torque_nm", "measured_nm")
        return np.mean([[np.abs(run["reference_nm"] - run[one])[5000:].max() for one in seen] for run in runs], axis=0)

    (rc, rc_seen), (pi, pi_seen) = largest("RC, Table IV"), largest(PAPER)
    assert f"{rc:.3f} N·m against {pi:.3f} N·m over twenty seeds" in TEXT
    assert f"is {rc_seen:.3f} and {pi_seen:.3f} N·m" in TEXT


@pytest.mark.parametrize(
    ("start", "options"),
    [
        ("pooled, 1/b0 (the paper's)", {}),
        pytest.param("minimax, 2 B_m B_M/(B_m + B_M)", {"b_hat": "minimax"}, marks=pytest.mark.slow),
    ],
)
def test_row_of_B_hat(tuned, start, options):
    found = tuned(nonlinear=True, **options)
    rc = found.rc
    row = (
        f"| {start} | {rc.B_hat:.1f} | {rc.alpha:.4f} | {rc.alpha_reached:.4f} | {'yes' if rc.rho_covers else 'no'} "
        f"| {rc.ultimate_bound_nm:.3g} N·m | {found.replayed.rc.max_abs_error_nm:.3f} N·m |"
    )
    assert row in TEXT


def test_readings_mismatch_and_slope(tuned):
    for reading, constant in (("paper", "10.8125"), ("textbook", "6.09765")):
        rc = tuned(rho=reading).rc
        assert f"{rc.rho.constant:.6g}" == constant and f"{constant} + {rc.rho.slope:.6g} ‖ξ‖" in TEXT
        assert f"{rc.phi_honest_pct:.3g} % duty" in TEXT
    linear = {"a0": 1.84393, "b0": 0.0782825, "c0": -1.343124, "bounds": {"B_m": 8.349, "B_M": 41.142}}
    published, fitted = tuned(nonlinear=True), tuned(nonlinear=True, linear=linear)
    needed = [gains.guarantee.conditions[1].needed for gains in (published, fitted)]
    assert f"{needed[0]:.1f} % duty" in TEXT and f"{needed[1]:.1f} % for the model" in TEXT
    assert f"{published.rc.phi_honest_pct:.1f} % and {fitted.rc.phi_honest_pct:.1f} %" in TEXT
    assert f"{published.replayed.slope_nm_s:.2f} N·m/s" in TEXT


@pytest.mark.slow
def test_what_another_B_hat_leaves(fit, rows):
    """The error with less duty for a slope, and the α that the guarantee would need."""
    other = eaid.tune_rc(fit, b_hat=8.16)
    papers, done = (
        replayed(fit, row, noise_nm=0.01).metrics.rms_error_nm for row in (rows["RC, Table IV"], (other, "rc"))
    )
    assert f"stays at {papers:.4f} N·m" in TEXT
    assert f"`--b-hat 8.16` leaves {done:.4f} N·m, {100 * (1 - done / papers):.0f} % less" in TEXT
    assert f"α reached of {other.rc.alpha_reached:.3f}" in TEXT


@pytest.mark.slow
def test_what_mending_leaves(fit):
    found, mended = eaid.tune_rc(fit), eaid.tune_rc(fit, b_hat="minimax", phi="data", reference="multisine")
    assert set(found.guarantee.missing) == {"rho", "phi", "Q_M", "duty-limit", "duty-floor"}
    assert set(mended.guarantee.missing) == {"duty-limit", "duty-floor"}
    before, after = ((one.margins.worst["rc"].gain_db, one.replayed.rc.max_abs_error_nm) for one in (found, mended))
    assert f"leave {after[0]:.1f} dB for {before[0]:.1f} dB, an error of {after[1]:.3f} for {before[1]:.3f} N·m" in TEXT


@pytest.mark.slow
def test_the_readme_compares_what_the_code_prints():
    """At equal margins, on the logs that its own commands make."""
    text = re.sub(r"\s+", " ", (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8"))
    gains = eaid.tune_rc(eaid.fit(eaid.synth(repeats=3), ci="none"))
    least, done = gains.margins.worst["rc"], gains.replayed
    own, alike, fed = (getattr(done, name).max_abs_error_nm for name in ("rc", "equal_pi", "equal_pi_feedforward"))
    assert f"{least.gain_db:.0f} dB and {least.phase_deg:.0f}° in hand" in text
    assert f"a largest error of {own:.2f} N·m on the multisine; a PI of the same margins leaves {alike:.2f}" in text
    assert f"({alike / own:.1f} ×), with the same feedforward {fed:.3f}: the robust term itself is worth" in text
    assert f"is worth {100 * (1 - own / fed):.0f} % (" in text
    walkthrough = (Path(__file__).parents[2] / "docs/walkthrough.md").read_text(encoding="utf-8")
    for one in (done.rc, done.equal_pi_feedforward, done.equal_pi, done.pi):
        assert re.search(rf"{one.gain_db:.1f} +{one.phase_deg:.1f} +{one.max_abs_error_nm:#.3g}\n", walkthrough)
