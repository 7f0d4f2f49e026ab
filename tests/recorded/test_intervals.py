"""The variance of the scores, estimated from residuals that the fit has taken power out of."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from eaid.models.parameters import REFERENCE_PLANT
from eaid.options import FitOptions
from eaid.recorded import model
from eaid.recorded.fit import fit_recorded
from eaid.recorded.intervals import _root, score_test, spread
from eaid.recorded.log import recorded_log
from eaid.recorded.noise import by_spectrum, moving, piece_of
from eaid.recorded.solve import setup_of, solve
from eaid.synth.excitation import Excitation, synthesise_excitation
from eaid.synth.logs import NONE
from eaid.synth.plants import clutch

RATE_HZ, MEMORY_S, SHARE = 100.0, 0.3, 0.01
KEPT = np.exp(-1 / RATE_HZ / MEMORY_S)


@pytest.mark.slow
def test_both_ways_give_back_what_the_fit_took_out_of_the_residuals() -> None:
    """A staircase of 12 s, linearised: noise of 1 % of the torque (AR(1)), whose score variance is known exactly."""
    e = Excitation(kind="staircase", duration_s=240.0, rate_hz=RATE_HZ, hold_s=(0.5, 12.0))
    log = recorded_log(synthesise_excitation(clutch(), e, NONE, 0)[0])
    setup = setup_of(model.nonlinear(np.linspace(10, 100, 10), 0.85, 240.0), [log]).every
    assert setup.model.basis is not None
    x = np.append(setup.model.basis.unknowns(REFERENCE_PLANT), 0.0)
    J = setup.jacobian(x, 0)[0]
    pull = np.linalg.inv(J.T @ J)
    T = log.output
    scaled = J * T[:, None]
    M = scaled.T @ lfilter([1.0], [1.0, -KEPT], scaled, axis=0)
    exact = SHARE**2 * (M + M.T - scaled.T @ scaled)
    slopes = setup.model.slopes(np.linspace(10, 100, 10), len(x))[2]  # τ2

    def variances(omega: np.ndarray) -> np.ndarray:
        return np.einsum("di,ij,dj->d", slopes @ pull, omega, slopes @ pull)

    draw = np.random.default_rng(1)
    found: dict[str, list[np.ndarray]] = {"spectrum": [], "taken": [], "stretches": [], "degrees": []}
    for _ in range(40):
        noise = lfilter([np.sqrt(1 - KEPT**2)], [1.0, -KEPT], draw.standard_normal(len(T))) * SHARE * T
        r = J @ (pull @ (J.T @ noise)) - noise
        piece = piece_of(J, r, setup.places[0].columns, len(x), replace(setup.drives[0], y=T + noise), 0.0)
        lines = by_spectrum(piece, pull)
        found["spectrum"].append(variances(lines.total))
        found["degrees"].append(np.array([lines.degrees(pull @ g)[1] for g in slopes]))
        found["taken"].append(variances(by_spectrum(piece, 0 * pull).total))
        white = _root(pull)
        back = np.linalg.pinv(white)
        found["stretches"].append(variances(back.T @ moving(piece, white, round(10 / piece.bin_s)) @ back))
    degrees = np.mean(found.pop("degrees"), axis=0)
    seen = np.array(found["spectrum"])
    as_scattered = 2 * seen.mean(axis=0) ** 2 / seen.var(axis=0, ddof=1)
    assert 0.5 < np.median(degrees / as_scattered) < 2.5
    ratio = {name: float(np.mean(np.mean(rows, axis=0) / variances(exact))) for name, rows in found.items()}
    assert ratio["taken"] < 0.97 * ratio["spectrum"]
    assert 0.9 < ratio["spectrum"] < 1.15
    assert 0.85 < ratio["stretches"] < 1.3


@pytest.mark.slow
def test_intervals_hold_what_engagements_scatter() -> None:
    """Gains that differ by 2 % from engagement to engagement: T_s and τ1 of most logs lie within their intervals."""
    from eaid.models.nonlinear import steady_torque, time_constants

    noise = replace(NONE, white_nm=0.006, coloured=0.01, coloured_s=0.3)
    e = Excitation(kind="random", duration_s=240.0, rate_hz=50.0, hold_s=(0.5, 8.0), rest_s=8.0)
    held = []
    for seed in range(8):
        run = synthesise_excitation(clutch(), e, noise, 500 + seed)[0]
        which = np.cumsum(np.append(0, (run.input[1:] > 0) & (run.input[:-1] == 0)))
        gain = 1 + 0.02 * np.random.default_rng(seed).standard_normal(int(which.max()) + 1)
        options = FitOptions(model=("nonlinear",), duty=(10.0, 100.0))
        fit = fit_recorded([replace(run, output=run.output * gain[which])], options)
        assert fit.nonlinear is not None
        for one in fit.nonlinear.curves:
            assert one.ci95 is not None
            truth = steady_torque(REFERENCE_PLANT, one.level), time_constants(REFERENCE_PLANT, one.level)[0]
            for true, ends in zip(truth, (one.ci95.Ts, one.ci95.tau1), strict=True):
                held.append(ends is not None and ends[0] <= true <= ends[1])
    assert np.mean(held) > 0.8


def test_ends_are_those_of_a_parabola_where_the_cost_is_one_and_of_the_score_test_where_it_is_none() -> None:
    """A staircase of 12 s: T_s, in which the response is all but linear, and τ2, whose ends are where the step that the
    residuals ask for is what the noise allows there."""
    noise = replace(NONE, white_nm=0.006, coloured=0.01, coloured_s=0.3)
    e = Excitation(kind="staircase", duration_s=240.0, rate_hz=50.0, hold_s=(0.5, 12.0))
    log = recorded_log(synthesise_excitation(clutch(), e, noise, 0)[0])
    solved = solve(setup_of(model.nonlinear(np.linspace(10, 100, 10), 0.85, 240.0), [log]))
    sure = spread(solved)
    test = score_test(solved, sure)
    slopes = solved.setup.model.slopes(np.array([100.0]), solved.setup.size)[:, 0]
    half = 0.2 * sure.of(slopes[0])
    assert np.mean(test.ends(slopes[0], half)) == pytest.approx(half / float(slopes[0] @ solved.x), rel=0.05)
    tau2 = float(slopes[2] @ solved.x)
    for end, sign in zip(test.ends(slopes[2], 0.3 * tau2), (-1, 1), strict=True):
        x = test.held(slopes[2], sign * end)
        assert x is not None
        assert slopes[2] @ x == pytest.approx(tau2 * np.exp(sign * end), rel=1e-6)
        step, variance = test.step(x, slopes[2])
        usual = test.step(test.x, slopes[2])[1]
        assert abs(step) == pytest.approx(0.3 * tau2 * (variance / usual) ** 0.5, rel=0.03)
        assert np.sign(step) == sign
