"""Synthetic logs against the plant's own step, by closed form, and against the statistics that they claim."""

import json
from pathlib import Path

import numpy as np
import pytest

import eaid

from ..conftest import PLANT

TWO = "--levels 40,90 --repeats 2 --idle 0.5 --hold 2 --release 1 --rate-hz 200"


def fit_of(**parts) -> str:
    Path("fit.json").write_text(json.dumps({"schema": "eaid/fit/2", "nonlinear": PLANT, **parts}))
    return "fit.json"


@pytest.fixture
def logs(tmp_path, monkeypatch, run_eaid):
    """`logs("--levels 40 …")`: `eaid synth` into a folder; time, input and output of each of its files by name."""
    monkeypatch.chdir(tmp_path)

    def record(*words):
        ran = run_eaid("synth", *" ".join(map(str, words)).split(), "-o", "logs", "--force", "-q")
        assert ran.code == 0, ran.err
        return {path.stem: np.loadtxt(path, delimiter=",", skiprows=2).T for path in sorted(Path("logs").iterdir())}

    return record


def test_a_dataset_has_the_numbers_of_its_folder_of_csv_and_another_seed_has_others(logs, run_eaid):
    names = [f"synthetic-clutch-{level}-r{repeat}" for level in ("040.0", "090.0") for repeat in (1, 2)]
    assert list(logs(TWO)) == names
    ran = run_eaid("synth", *TWO.split(), "--json")
    told = json.loads(ran.out)
    assert ran.err == ("synthetic.h5: 4 synthetic runs of the reference plant (docs/synthetic.md), seed 0; "
                       "next: eaid fit synthetic.h5\n")  # fmt: skip
    assert (told["kind"], told["seed"]) == ("clutch", 0) and told["runs"][0]["samples"] == 700
    assert [row["level"] for row in told["runs"]] == [40, 40, 90, 90]
    assert run_eaid("synth", *TWO.split(), "-q", "-o", "b.h5", "--seed", "1").code == 0
    assert Path("synthetic.h5").read_bytes() != Path("b.h5").read_bytes()
    one, other = eaid.read("synthetic.h5"), eaid.read("logs")
    assert "recorded on no rig" in one.synthetic
    assert sorted((run.level, run.step_s) for run in one.runs) == [
        (u, at) for u in (40, 90) for at in (0.5, 0.5, 2.5, 2.5)
    ]
    for first, second in zip(one.levels, other.levels, strict=True):
        assert first.level == second.level
        np.testing.assert_array_equal(first.runs, second.runs)


def rise(t, Ts, tau1, tau2, C=0.85):
    return Ts * (1 - C * np.exp(-t / tau1) - (1 - C) * np.exp(-t / tau2))


def at(u):
    """T_s, τ1 and τ2 of the reference plant."""
    return (np.polyval(PLANT[name][::-1], u) for name in ("Ts", "tau1", "tau2"))


def test_a_clean_clutch_run_is_equation_4_and_falls_with_its_constants_at_zero_duty(logs):
    words = "--levels 40 --repeats 1 --idle 0.5 --hold 20 --release 5 --rate-hz 200 --clean"
    ((t, duty, torque),) = logs(words).values()
    held, after = (t >= 0.5) & (t < 20.5), t >= 20.5
    assert np.all(torque[t < 0.5] == 0.0) and np.all(duty == np.where(held, 40.0, 0.0))
    np.testing.assert_allclose(torque[held], rise(t[held] - 0.5, *at(40.0)), atol=1e-13)
    # specification 4.2: below 10 % the time constants keep the values they have there
    Ts, *taus = at(40.0)
    _, *slow = at(10.0)
    left = [share * Ts * -np.expm1(-20 / tau) for share, tau in zip((0.85, 0.15), taus, strict=True)]
    falling = sum(x * np.exp(-(t[after] - 20.5) / tau) for x, tau in zip(left, slow, strict=True))
    np.testing.assert_allclose(torque[after], falling, atol=1e-12)


@pytest.mark.parametrize("release", [None, {"tau1": 0.7, "tau2": 3.0}])
def test_any_stepwise_duty_moves_the_states_as_the_replay_does(logs, release):
    draw, rows, now = np.random.default_rng(0), [], 0.0
    for _ in range(30):
        rows.append((now, draw.uniform(0, 100) * (draw.uniform() > 0.2)))
        now = round(now + 0.01 * draw.integers(1, 150), 2)
    lines = [f"{at:g},{duty:.9g}" for at, duty in [(0.0, 0.0), *((at + 1, duty) for at, duty in rows), (now + 1, 0.0)]]
    Path("duty.csv").write_text("\n".join(["time_s,duty_pct", *lines]))
    fit = fit_of(release=release)
    logs("--plant", fit, "--duty-file duty.csv --repeats 1 --rate-hz 100 --clean")
    (record,) = eaid.simulate(eaid.load(fit), log="logs").records.values()
    assert record.metrics.max_abs_difference_nm < 1e-10


@pytest.mark.parametrize(
    ("kind", "level", "expected", "rotor"),
    [("friction-force", 170, (2.4645, 0.4164, 5.0745), 15.0),
     ("friction-speed", 15, (0.349 * 0.031746 + 1.042 * 1.095488, 0.04383, 4.641), 15.0)],
)  # fmt: skip
def test_clean_friction_runs_are_equation_3_with_tables_one_and_two(logs, kind, level, expected, rotor):
    (t, _, torque) = logs(f"--kind {kind} --levels {level} --repeats 1 --rate-hz 50 --clean").popitem()[1]
    np.testing.assert_allclose(torque[t >= 2.0], rise(t[t >= 2.0] - 2.0, *expected), atol=1.5e-4 * expected[0])
    assert t[-1] == pytest.approx(62.0 - 0.02)


def test_the_same_seed_gives_the_same_runs_and_every_file_says_what_it_is(logs):
    first = logs(TWO, "--seed 5")
    head, columns = Path("logs/synthetic-clutch-040.0-r1.csv").read_text().splitlines()[:2]
    assert head == (
        "# synthetic: eaid synth of the reference plant (docs/synthetic.md); white_nm 0.01, coloured 0.01, coloured_s "
        "0.05, ripple 0.01, gain_scatter 0.03, tau1_scatter 0.05, offset_nm 0.02, resolution_nm 0.000976562; seed 5; "
        "recorded on no rig"
    )
    assert columns == "time_s,duty_pct,torque_nm"
    again, other, more = logs(TWO, "--seed 5"), logs(TWO, "--seed 6"), logs(TWO.replace("ts 2", "ts 3"), "--seed 5")
    for name, run in first.items():
        assert np.array_equal(run, again[name]) and np.array_equal(run, more[name])
        assert not np.array_equal(run, other[name])
    logs(TWO, "--clean")
    assert "; undisturbed; seed 0;" in Path("logs/synthetic-clutch-040.0-r1.csv").read_text()


WEAK = "--levels 10 --repeats 1 --idle 0.1 --release 0 --rate-hz 1000 --clean"


def test_white_noise_offset_and_digits_are_as_asked(logs):
    ((_, _, clean),), ((_, _, seen),) = (
        logs(WEAK, "--hold 60", more).values() for more in ("", "--noise-nm 0.02 --offset-nm 0.3")
    )
    left = seen - clean
    assert left.mean() == pytest.approx(0.3, abs=4e-4) and left.std() == pytest.approx(0.02, rel=0.02)
    digits = 1024 * logs("--levels 10 --repeats 1 --hold 1")["synthetic-clutch-010.0-r1"][2]
    assert np.array_equal(digits, np.round(digits))


def test_ripple_turns_with_the_rotor_and_coloured_noise_has_its_time_constant_both_as_shares_of_the_torque(logs):
    words = "--levels 80 --repeats 1 --idle 0 --release 0 --rate-hz 200 --clean --hold 600"
    (clean,), (wave,), (noise,) = (
        logs(words, more).values() for more in ("", "--ripple 0.01", "--coloured 0.02 --coloured-s 0.05")
    )
    settled = clean[0] >= 60.0  # 90 turns of a rotor at 10 RPM
    share = wave[2][settled] / clean[2][settled] - 1
    spectrum = np.abs(np.fft.rfft(share)) * 2 / share.size
    assert int(np.argmax(spectrum)) == 90 and spectrum[90] == pytest.approx(0.01, rel=1e-9)
    share = noise[2][settled] / clean[2][settled] - 1
    assert share.std() == pytest.approx(0.02, rel=0.03)
    assert np.mean(share[:-10] * share[10:]) / np.mean(share**2) == pytest.approx(np.exp(-1.0), abs=0.03)


def test_scatter_between_runs_is_as_asked(logs):
    words = "--levels 50 --idle 0 --hold 0.4 --release 0 --rate-hz 50 --clean --repeats"
    (clean,), runs = logs(words, 1).values(), logs(words, 400, "--gain-scatter 0.03 --tau1-scatter 0.05").values()
    # at first T ≈ gain · C T_s t / τ1 · …: gain and log τ1 both scatter the torque, in square 0.03² + 0.05² nearly
    early = np.array([run[2][1] for run in runs]) / clean[2][1]
    assert early.mean() == pytest.approx(1.0, abs=0.01)
    assert early.std() == pytest.approx(np.hypot(0.03, 0.05 * 0.94), rel=0.08)


def test_a_plant_behind_a_dead_time_answers_late_to_any_input(logs):
    """Steps and random inputs had none of it, closed loops had."""
    lag = {"kind": "lag", "Ts": [0, 0.05, 0, 0], "tau1": [0.3], "tau2": [0.3], "C": 1.0, "u_range": [20, 100]}
    plant = fit_of(plant=lag | {"dead_time_s": 0.06})
    for how in ("--levels 60 --repeats 1 --idle 1 --hold 2 --release 0", "--excitation random --shape duration_s=20"):
        t, duty, torque = logs("--plant", plant, "--clean --rate-hz 100", how).popitem()[1]
        begins, answers = t[np.flatnonzero(duty)[0]], t[np.flatnonzero(torque)[0]]
        assert answers - begins == pytest.approx(0.07, abs=1e-9)  # the first row behind it that has moved


def test_a_fits_own_release_units_and_friction_levels_are_recorded(logs):
    plant = {"tau1": [0.2, 1e-3, 0.0], "tau2": [3.0, 0.0, 0.0], "Ts": [0.0, 0.01, 0.0, 0.0], "u_range": [30, 300]}
    data = {"input_unit": "V", "output_unit": "N", "levels": [30.0, 150.0, 300.0]}
    fit = fit_of(data=data, nonlinear={"C": 0.85, **plant}, release={"tau1": 1.0, "tau2": 1.0})
    runs = logs("--plant", fit, "--clean --repeats 1 --idle 1 --hold 20 --release 5 --rate-hz 100")
    assert [run[1].max() for run in runs.values()] == [30.0, 150.0, 300.0]
    t, _, torque = list(runs.values())[2]
    held = (t >= 1.0) & (t < 21.0)
    np.testing.assert_allclose(torque[held], rise(t[held] - 1.0, 3.0, 0.5, 3.0), atol=1e-12)
    assert torque[t >= 21.5][0] / torque[t >= 21.0][0] == pytest.approx(np.exp(-0.5), rel=1e-9)
    steps = eaid.synth(eaid.load(fit), repeats=1, hold_s=2.0, levels=(200.0,))  # no limit of 100
    assert (steps.input_unit, steps.output_unit) == ("V", "N")
    assert "white_nm 0.00686" in steps.synthetic  # 0.01 N·m of 4.372 N·m, for 3 N at the top
    levels = [{"level": 50, "Ts": 1, "tau1": 0.1, "tau2": 2}]
    fit = fit_of(data={"kind": "friction-force"}, nonlinear=None, friction={"C": 0.8, "levels": levels})
    t, force, torque = logs("--plant", fit, "--clean --repeats 1 --rate-hz 100").popitem()[1]
    np.testing.assert_allclose(torque[t >= 2.0], rise(t[t >= 2.0] - 2.0, 1.0, 0.1, 2.0, 0.8), atol=1e-12)
    assert force.max() == 50.0
    for more, sentence in (({"levels": (60.0,)}, r"levels= 60: is not in .*, which holds 50"),
                           ({"kind": "friction-speed"}, "ask for kind= friction-force")):  # fmt: skip
        with pytest.raises(eaid.UsageError, match=sentence):
            eaid.synth(eaid.load(fit), **more)


def test_force_replaces_earlier_synthetic_runs_and_nothing_else(logs, run_eaid):
    assert len(logs(TWO)) == 4 and set(logs(TWO.replace("40,90", "70"))) == {
        "synthetic-clutch-070.0-r1", "synthetic-clutch-070.0-r2",
    }  # fmt: skip
    assert "exists already; give --force" in run_eaid("synth", *TWO.split(), "-o", "logs").err
    for own in ("run7.csv", "synthetic-notes.csv"):  # the name alone says nothing
        Path("logs", own).write_text("recorded\n")
        for output, sentence in (
            ("logs", f"holds {own}, which eaid synth did not make"), (f"logs/{own}", "is no folder"),
            ("none/logs", "does not exist; make it first"),
        ):  # fmt: skip
            ran = run_eaid("synth", *TWO.split(), "-o", output, "--force")
            assert ran.code == 2 and sentence in ran.err and Path("logs", own).read_text() == "recorded\n"
        Path("logs", own).unlink()


DUTY = "time_s,duty_pct\n"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("t,u\n0,1\n", "its header is not time_s,duty_pct"),
        (f"{DUTY}0,1\n", r"holds 1 row\(s\)"),
        (f"{DUTY}0,1\n1,x\n", "row 3 holds '1,x', not 2 finite numbers"),
        (f"{DUTY}0,1\n1,101\n", "row 3 holds duty_pct 101, outside 0 to 100 %"),
        (f"{DUTY}0,1\nnan,10\n", "row 3 holds 'nan,10', not 2 finite numbers"),
        (f"{DUTY}0,1\n0,2\n", "time does not rise at row 3"),
        ("\0\xff", "is no text"),
    ],
)
def test_bad_duty_files_are_refused_in_a_sentence(tmp_path, text, sentence):
    path = tmp_path / "table.csv"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(eaid.EaidError, match=sentence):
        eaid.synth(duty_file=path)


def test_a_duty_file_is_read_from_its_own_start(logs):
    Path("duty.csv").write_text("# mine\ntime_s,duty_pct\n5,0\n6,40\n\n8.5,0\n9,0\n")
    t, duty, _ = logs("--duty-file duty.csv --rate-hz 100 --repeats 1").popitem()[1]
    assert t.size == 400 and [duty[k] for k in (0, 99, 100, 349, 350)] == [0, 0, 40, 40, 0]


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"levels": ()}, "levels=: give at least one level"),
        ({"levels": (10.0, 10.0)}, "stands there twice"),
        ({"levels": (120.0,)}, "a duty is at most 100 %"),
        ({"hold_s": 0.01, "rate_hz": 100.0}, "hold_s= 0.01: fewer than 10 samples at 100 Hz; .*raise rate_hz="),
        ({"rate_hz": 1e5, "hold_s": 2000.0}, "million samples, 20 million at most"),
        ({"coloured": 0.1, "coloured_s": 0.0}, "coloured_s= 0: coloured noise needs"),
        ({"kind": "friction-force", "release_s": 1.0}, "release_s=: nobody has published"),
    ],
)
def test_what_cannot_be_recorded_is_refused(options, sentence):
    with pytest.raises(eaid.UsageError, match=sentence):
        eaid.synth(**options)
