"""Shapes of single steps: exact slopes, every shape found again under noise, the shape that is chosen, real rigs."""

import math
from pathlib import Path

import numpy as np
import pytest
from eaid.fitting.choices import check
from scipy.optimize import least_squares

from eaid.errors import UsageError
from eaid.fitting.shape_curves import curve, slopes
from eaid.fitting.step_shapes import fit_step, independent, may_ask
from eaid.options import FitOptions
from eaid.results.fit import StepShape
from eaid.steps.stepset import LevelStep

REALDATA = Path(__file__).parents[2] / "../shared/realdata"
needs_realdata = pytest.mark.skipif(not REALDATA.is_dir(), reason="the recorded logs are not beside the project")
T = np.arange(4000) / 200.0
TRUTHS = {
    "one": np.array([3.0, math.log(0.8), 1.0, 1.0, 0.0]),
    "two": np.array([3.0, math.log(0.3), math.log(4.0 / 0.3), 0.85, 0.0]),
    "free": np.array([3.0, math.log(0.4), math.log(10.0), 0.5, 0.0]),
    "overshoot": np.array([3.0, math.log(0.4), math.log(10.0), 1.4, 0.0]),
}


def made(p: np.ndarray, noise: float = 0.0, seed: int = 0, t: np.ndarray = T, start: float = 1.5) -> LevelStep:
    y = start + curve(p, t) + noise * np.random.default_rng(seed).normal(size=len(t))
    return LevelStep("a", "a.csv", 20.0, 50.0, start, t, y, np.full(len(t), 50.0))


@pytest.mark.parametrize("name", TRUTHS)
@pytest.mark.parametrize("dead", [0.0, 0.503])
def test_slopes_are_exact(name: str, dead: float) -> None:
    p = TRUTHS[name] + np.array([0, 0, 0, 0, dead])
    t = T[::37] + 1e-3
    exact = slopes(p, t)
    for k in range(5):
        moved = p.astype(complex)
        moved[k] += 1e-30j
        after = np.where(t > dead, t - moved[4], 0.0)
        fast, slow = np.exp(-after / np.exp(moved[1])), np.exp(-after / np.exp(moved[1] + moved[2]))
        y = moved[0] * (1 - moved[3] * fast - (1 - moved[3]) * slow)
        np.testing.assert_allclose(exact[:, k], y.imag / 1e-30, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("name", TRUTHS)
@pytest.mark.parametrize("dead", [0.0, 0.5])
def test_every_shape_is_found_again_without_noise(name: str, dead: float) -> None:
    p = TRUTHS[name] + np.array([0, 0, 0, 0, dead])
    found = fit_step(made(p))
    assert found.shape == name
    assert found.dead_time_s == pytest.approx(dead, abs=1e-6)
    assert found.change == pytest.approx(3.0, rel=1e-6)
    assert found.tau1 == pytest.approx(math.exp(p[1]), rel=1e-5)
    assert found.rmse < 1e-7
    if name != "one":
        assert found.tau2 == pytest.approx(math.exp(p[1] + p[2]), rel=1e-4)
        assert pytest.approx(p[3], rel=1e-5) == found.C


@pytest.mark.slow
@pytest.mark.parametrize("name", TRUTHS)
@pytest.mark.parametrize("dead", [0.0, 0.5])
def test_the_right_shape_is_chosen_under_noise(name: str, dead: float) -> None:
    p = TRUTHS[name] + np.array([0, 0, 0, 0, dead])
    found = [fit_step(made(p, 0.03, seed)) for seed in range(10)]
    assert [(one.shape, one.dead_time_s > 0) for one in found].count((name, dead > 0)) >= 9
    assert np.mean([one.change for one in found]) == pytest.approx(3.0, abs=0.02)
    assert np.mean([one.tau1 for one in found]) == pytest.approx(math.exp(p[1]), rel=0.05)
    assert np.mean([one.rmse for one in found]) == pytest.approx(0.03, rel=0.02)


def test_the_evidence_is_that_of_all_samples() -> None:
    """A second exponential that is not there is better by chance, χ² with one degree, not by five times that."""
    found = [fit_step(made(TRUTHS["one"], 0.03, seed)).evidence for seed in range(10)]
    gains = [float((one["one"] or 0.0) - (one["two"] or 0.0)) + 2 for one in found]
    assert np.mean(gains) == pytest.approx(1.0, abs=1.0)
    assert max(gains) < 9


def test_a_slow_part_far_beyond_the_record_is_found() -> None:
    """Its slope is all that is seen of it: a start from the grid's best place alone ends in another valley."""
    p = np.array([1.0, math.log(0.3), math.log(200.0 / 0.3), 0.85, 0.0])
    found = fit_step(made(p, 0.001), FitOptions(shape="two", dead_time_s=0.0))
    assert found.tau2 == pytest.approx(200.0, rel=0.2)
    assert found.rmse == pytest.approx(0.001, rel=0.05)


def test_quality_by_hand() -> None:
    step = made(TRUTHS["two"], 0.1)
    found = fit_step(step)
    y = step.output
    left = y - found.predict(step.time_s)
    assert found.rmse == pytest.approx(math.sqrt(float(left @ left) / len(y)))
    assert found.fit_pct == pytest.approx(100 * (1 - np.linalg.norm(left) / np.linalg.norm(y - y.mean())))
    assert pytest.approx(1 - float(left @ left) / float(((y - y.mean()) ** 2).sum())) == found.R2
    assert found.gain == pytest.approx(found.change / 30.0)
    assert (found.from_, found.level, found.edge, found.start) == (20.0, 50.0, "up", 1.5)


def test_options() -> None:
    step = made(TRUTHS["overshoot"], 0.03)
    held = fit_step(step, FitOptions(shape="two", dead_time_s=0.0, share=0.7))
    assert (held.shape, held.C, held.dead_time_s) == ("two", 0.7, 0.0)
    assert held.rmse > 2 * fit_step(step).rmse
    assert fit_step(made(TRUTHS["one"]), FitOptions(shape="one", dead_time_s=0.25)).dead_time_s == 0.25
    for wrong in (FitOptions(shape="three"), FitOptions(dead_time_s=-1.0), FitOptions(dead_time_s=math.nan)):
        with pytest.raises(UsageError):
            check(wrong)


def test_slow_noise_does_not_make_a_shape() -> None:
    """Noise with a memory of a tenth of a second counts for fewer samples."""
    random = np.random.default_rng(3)
    chosen = []
    for _ in range(10):
        slow = np.zeros(len(T))
        push = 0.03 * np.sqrt(1 - 0.95**2) * random.normal(size=len(T))
        for k in range(1, len(T)):
            slow[k] = 0.95 * slow[k - 1] + push[k]
        step = made(TRUTHS["two"])
        chosen.append(fit_step(LevelStep("a", "", 0.0, 50.0, 1.5, T, step.output + slow, step.input)).shape)
    assert chosen.count("two") >= 9


def test_what_is_no_step_says_so() -> None:
    wave = LevelStep("w", "", 0.0, 50.0, 0.0, T, np.sin(2 * np.pi * T / 7), np.full(len(T), 50.0))
    (said,) = fit_step(wave).findings
    assert (said.code, said.severity) == ("shape-explains-little", "stop")


def _read(name: str, **options: object) -> tuple[StepShape, ...]:
    from eaid.cli.inputs import runs_from
    from eaid.options import ReadOptions

    return tuple(map(fit_step, runs_from([REALDATA / "rigs" / name], ReadOptions(**options))[1].level_steps))


@needs_realdata
def test_lamp_staircase() -> None:
    rows = _read("light_staircase.csv", columns="time=2,input=3,output=1", units="time=us,output=mV,input=PWM")
    assert [(row.from_, row.level) for row in rows] == [(0, 50), (50, 100), (100, 150), (150, 200), (200, 0)]
    first = rows[0]
    assert (first.shape, first.dead_time_s) == ("two", 0)
    assert first.change == pytest.approx(1.844, abs=0.001)
    assert (first.tau1, first.tau2) == (pytest.approx(0.0185, rel=0.01), pytest.approx(0.201, rel=0.01))
    gains = [row.gain for row in rows]
    assert gains == pytest.approx([0.0369, 0.01308, 0.00739, 0.00492, 0.01557], rel=0.01)


@needs_realdata
def test_heaters() -> None:
    (row,) = _read("heater_dead_time.csv", columns="time=Time,input=Q1,output=T1", units="output=degC", repair=True)
    assert (row.shape, row.start) == ("one", 20.9)
    assert row.change == pytest.approx(35.0, abs=0.5)
    assert 13 < row.dead_time_s < 16
    assert row.rmse == pytest.approx(0.27, abs=0.01)
    (row,) = _read("heater_on_from_first_row.csv", columns="time=Time,input=Q1,output=T1", units="output=degC")
    assert row.start == pytest.approx(20.63, abs=0.01)
    assert (row.shape, row.rmse < 0.2) == ("one", True)


def test_a_staircase_without_rest_is_fitted_all_the_same() -> None:
    from eaid.apparatus import Apparatus
    from eaid.steps.stepset import StepSet
    from eaid.uncertainty.workflow import fit_steps as whole_fit

    step = made(TRUTHS["one"] + np.array([0, 0, 0, 0, 0.5]), 0.01)
    result = whole_fit(StepSet("clutch", "%", "N·m", Apparatus(), (), level_steps=(step,)))
    (row,) = result.steps
    assert (row.from_, row.level, row.shape) == (20.0, 50.0, "one")
    assert result.converged and result.linear is None and result.friction is not None
    assert [(one.from_, one.level, one.delay_s) for one in result.friction.levels] == [(20.0, 50.0, row.dead_time_s)]
    (said,) = result.findings
    assert (said.code, said.severity) == ("other-shape-fits-better", "caution")
    assert said.values["dead_time_s"] == pytest.approx(0.5, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("name", TRUTHS)
@pytest.mark.parametrize("dead", [0.0, 0.02, 0.1, 0.5])
def test_whatever_asks_for_another_shape_is_let_through(name: str, dead: float) -> None:
    """The quick look may let through what then does not ask, never keep back what does; the paper's form it keeps."""
    for noise, seed in ((0.003, 1), (0.03, 2), (0.3, 3)):
        step = made(TRUTHS[name] + np.array([0, 0, 0, 0, dead]), noise, seed)
        asks = any(one.code == "other-shape-fits-better" for one in fit_step(step).findings)
        assert may_ask(step, FitOptions()) >= asks
        assert asks == (name in ("free", "overshoot") or dead > 0) or noise > 0.003
        if name in ("one", "two") and dead == 0:
            assert not may_ask(step, FitOptions())


def test_independent_samples_by_hand() -> None:
    """White noise counts whole; neighbours alike by ρ (1 + ρ)/(1 − ρ) times less; drift by how fifty blocks scatter."""
    random = np.random.default_rng(0)
    white = random.normal(size=4000)
    assert independent(white) == pytest.approx(4000, rel=0.35)
    pairs = np.repeat(random.normal(size=2000), 2) + 0.0
    alike = float((pairs - pairs.mean())[1:] @ (pairs - pairs.mean())[:-1]) / (4000 * pairs.var())
    assert independent(pairs) <= 4000 * (1 - alike) / (1 + alike) * (1 + 1e-9)
    drift = white + np.repeat(random.normal(size=50), 80)
    means = drift.reshape(50, 80).mean(axis=1) - drift.mean()
    assert independent(drift) == pytest.approx(4000 / (float(np.mean(means**2)) * 80 / drift.var()), rel=1e-9)
    assert independent(np.zeros(100)) == 100 and independent(np.sin(np.arange(100) / 50)) == 12.0


def test_an_overshoot_that_outlasts_the_record_is_the_best_with_a_slow_constant_as_long() -> None:
    t = np.arange(800) / 100.0
    step = made(np.array([3.0, math.log(0.4), math.log(40.0 / 0.4), 1.5, 0.0]), 0.01, 1, t)
    found = fit_step(step, FitOptions(shape="overshoot", dead_time_s=0.0))
    window = float(t[-1])
    assert found.tau2 == pytest.approx(window)

    def left(x: np.ndarray) -> np.ndarray:
        p = np.array([x[0], x[1], math.log(window) - x[1], x[2], 0.0])
        return np.asarray(curve(p, t) - (step.output - step.start))

    best = least_squares(left, [3.0, math.log(0.4), 1.5], xtol=1e-14, ftol=1e-14)
    assert found.rmse == pytest.approx(math.sqrt(2 * best.cost / len(t)), rel=1e-9)
    assert (found.change, found.tau1, found.C) == pytest.approx((best.x[0], math.exp(best.x[1]), best.x[2]), rel=1e-5)
