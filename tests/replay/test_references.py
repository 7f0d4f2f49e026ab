"""References: the paper's, and the user's own file with every fault it may have."""

import numpy as np
import pytest

from eaid.control.defaults import Scales
from eaid.errors import DataError, UsageError
from eaid.replay import references
from eaid.replay.references import SCENARIOS, reference_of

PAPER = Scales(True, 1.0, 1.0)


def scenario(name, dt_s, duration_s=None, pace=1.0):
    return reference_of(name, dt_s, PAPER._replace(pace=pace), duration_s)


def test_steps_go_up_and_down():
    made = references.steps(0.01)
    assert made.torque_nm[[0, 500, 2499, 4499]].tolist() == [0.0, 1.0, 4.0, 0.0]
    assert made.steps == tuple(500 * k for k in range(1, 9))
    assert references.steps(0.01, 3.0, levels_nm=(1.0, 1.0, 2.0)).steps == (200,)
    assert references.steps(0.01, 2.0, 0.5, levels_nm=(1.0, 3.0)).torque_nm.tolist() == [0.5] * 100 + [1.5] * 100
    assert scenario("steps", 0.01, 18.0).steps == tuple(200 * k for k in range(1, 9))
    assert scenario("steps", 0.01, pace=2.0).steps == tuple(250 * k for k in range(1, 9))


def test_the_multisine_is_spec_6():
    made = references.multisine(1e-3)
    t = 7.321
    wanted = 2 + sum(
        0.2 * np.sin(2 * np.pi * f * t + 1.7 * k) for f, k in zip((0.2, 0.5, 1, 2, 4), (0, 1, 4, 9, 16), strict=True)
    )
    assert made.torque_nm[7321] == pytest.approx(wanted, abs=1e-12)
    assert made.counted_from_s == 5.0
    assert np.abs(np.gradient(made.torque_nm, 1e-3)).max() == pytest.approx(9.3, abs=0.1)


def test_a_sweep_is_measured_over_whole_periods():
    made = references.sweep(1e-3)
    assert [tone.frequency_hz for tone in made.tones] == [
        0.2, 0.3, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0, 2.5, 3.0,
    ]  # fmt: skip
    for tone in made.tones:
        periods = (tone.end - tone.begin) * 1e-3 * tone.frequency_hz
        assert periods == pytest.approx(round(periods), abs=2e-3) and periods >= 2 - 2e-3
    assert made.tones[-1].end == len(made.torque_nm)
    # 10 s to settle and 5 s that count, in whole periods, two at least: at 0.2 Hz 2 + 2, at 3 Hz 30 + 15
    lengths = {f"{tone.frequency_hz:g}": (tone.begin, tone.end) for tone in made.tones}
    assert lengths["0.2"] == (10_000, 20_000) and lengths["0.3"] == (30_000, 36_667)
    last = made.tones[-1]
    assert last.end - last.begin == 5_000 and last.begin - made.tones[-2].end == 10_000
    assert made.counted_from_s == 10.0 and made.begin == 10_000


def test_the_ramp_rises_and_falls_at_one_slope():
    made = references.ramp(1e-2, top=0.5, pace=2.0)
    slopes = np.diff(made.torque_nm) / 1e-2
    assert len(made.torque_nm) == 500 and made.torque_nm[[0, -1]].tolist() == [0.0, 0.0]
    assert made.torque_nm.max() == pytest.approx(2.0, rel=5e-3)
    np.testing.assert_allclose(np.abs(np.delete(slopes, 249)), 0.8 * 500 / 499, rtol=1e-9)


@pytest.mark.parametrize("name", SCENARIOS)
def test_every_scenario_starts_at_or_above_nothing(name):
    made = scenario(name, 1e-2)
    assert len(made.torque_nm) > 100 and made.torque_nm.min() >= 0


def test_a_file_is_interpolated(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text("reference_nm,time_s\n0,1.0\n2,2.0\n\n1,2.5\n")
    made = references.sampled(*references.read_reference(path), 0.25, str(path))
    assert made.torque_nm.tolist() == [0.0, 0.5, 1.0, 1.5, 2.0, 1.5, 1.0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time_s,torque\n0,1\n", "its first row must name the columns time_s,reference_nm; it has time_s,torque"),
        ("", "its first row must name the columns time_s,reference_nm; it has nothing"),
        ("time_s,reference_nm\n0,1\n1,x\n", "reference_nm in row 3 is 'x', not a finite number"),
        ("time_s,reference_nm\n0,1\n1\n", "reference_nm in row 3 is '', not a finite number"),
        ("time_s,reference_nm\n0,1\n1,nan\n", "reference_nm in row 3 is 'nan'"),
        ("time_s,reference_nm\n0,1\n0,2\n", r"time does not rise at row 3 \(0 s after 0 s\)"),
        ("time_s,reference_nm\n0,1\n", "holds 1 row"),
        ("time_s,reference_nm\n0,1\n1e-4,2\n", "less than one control interval"),
    ],
)
def test_bad_files_are_refused(tmp_path, text, said):
    path = tmp_path / "r.csv"
    path.write_text(text)
    with pytest.raises(DataError, match=said) as refusal:
        references.sampled(*references.read_reference(path), 1e-3, str(path))
    assert str(refusal.value).startswith(str(path))


def test_a_reference_of_one_interval_has_two_samples():
    made = references.sampled(np.array([0.0, 1e-3]), np.array([1.0, 2.0]), 1e-3)
    assert made.torque_nm.tolist() == [1.0, 2.0]


def test_a_missing_or_binary_file_is_refused(tmp_path):
    with pytest.raises(DataError, match="no such file"):
        references.sampled(*references.read_reference(tmp_path / "none.csv"), 1e-3, str(tmp_path / "none.csv"))
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(DataError, match="no text file"):
        references.sampled(*references.read_reference(tmp_path / "b.csv"), 1e-3, str(tmp_path / "b.csv"))


def test_a_reference_longer_than_a_replay_is_refused():
    with pytest.raises(UsageError, match=r"lasts 90000 s, which is 90,000,001 control samples of 0.001 s"):
        references.sampled(np.array([10_000.0, 50_000.0, 100_000.0]), np.zeros(3), 1e-3)


def test_references_that_make_no_sense_are_refused():
    with pytest.raises(UsageError, match="a quarter of the control rate"):
        references.sweep(1e-3, frequencies_hz=(400.0,))
    with pytest.raises(UsageError, match="fewer than two control samples"):
        references.multisine(1e-3, 1e-4)
    with pytest.raises(UsageError, match="leave duration= out"):
        scenario("sweep", 1e-3, 5.0)
