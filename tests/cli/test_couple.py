"""`eaid couple`: table, file, exit codes; and the warning of the rehabilitation."""

import json
from pathlib import Path

import pytest

import eaid
from eaid.cli.main import run


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    where = tmp_path_factory.mktemp("couple")
    logs = eaid.synth(levels=(10.0, 40.0, 70.0, 100.0), repeats=2, rate_hz=100.0, clean=True)
    fit = eaid.fit(logs)
    fit.save(where / "fit.json")
    eaid.tune_rc(fit).save(where / "gains.json")
    return where


def call(folder: Path, *words: str) -> int:
    return run(["couple", str(folder / "fit.json"), "-o", str(folder / "couple.json"), "--force", *words])


def test_the_table_and_the_file_agree(folder: Path, capsys: pytest.CaptureFixture[str]):
    words = ("--gains", str(folder / "gains.json"), "--torque", "1,2", "--loops", "pi,rc-no-rate", "--wall", "3")
    assert call(folder, *words) == 0
    said = capsys.readouterr()
    walls = eaid.load(folder / "couple.json").walls
    assert [(wall.loop, wall.torque_nm) for wall in walls] == [
        ("pi", 1.0), ("rc-no-rate", 1.0), ("pi", 2.0), ("rc-no-rate", 2.0),
    ]  # fmt: skip
    assert walls[0].K_passive == pytest.approx(1.93, rel=0.05)
    assert f"{walls[0].K_passive:.3g}" in said.out
    assert "warning: pi: a wall of 3 N·m/rad is beyond what stays stable" in said.err
    assert "--" not in said.out


def test_json_is_the_file(folder: Path, capsys: pytest.CaptureFixture[str]):
    assert call(folder, "--torque", "1", "--no-replay", "--json", "-q") == 0
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads((folder / "couple.json").read_text(encoding="utf-8"))
    assert {wall["loop"] for wall in told["walls"]} == {"open-loop", "inverse"}


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        (("--torque", "99"), 2, "--torque 99: the fitted plant holds"),
        (("--limb-damping", "0"), 2, "--limb-damping 0: must be above 0"),
        (("--wall", "-1"), 2, "--wall -1: give a number above 0"),
        (("--delay-samples", "101"), 2, "--delay-samples 101: give a whole number from 0 to 100"),
        (("--loops", "pid"), 2, "--loops pid: must be one of"),
        (("--torque", "one"), 2, "--torque one: write numbers with commas"),
    ],
)
def test_what_means_nothing_is_refused(
    folder: Path, words: tuple[str, ...], code: int, says: str, capsys: pytest.CaptureFixture[str]
):
    assert call(folder, *words) == code
    assert says in capsys.readouterr().err


def test_springs_beyond_what_a_loop_keeps_stable_are_told(folder: Path):
    fit, gains = eaid.load(folder / "fit.json"), eaid.load(folder / "gains.json")
    replay = eaid.simulate(fit, gains, "rehab", controllers=("rc",), duration=20.0)
    assert "wall-beyond-stable" not in {one.code for one in replay.findings}
    with_pi = eaid.simulate(fit, gains, "rehab", controllers=("pi",), duration=20.0)
    assert {one.subject for one in with_pi.findings if one.code == "wall-beyond-stable"} == {"pi"}


def test_how_many_draws_the_constraints_cut_away_is_told(folder: Path, tmp_path: Path):
    plain = json.loads((folder / "fit.json").read_text(encoding="utf-8"))
    model = plain["nonlinear"]
    # the covariance is that of coefficients over the input in hundreds
    width = [2.0 * abs(c) * 100.0**k for part in ("tau1", "tau2", "Ts") for k, c in enumerate(model[part])]
    for scale, told in ((0.5, True), (1e-4, False)):
        matrix = [[(scale * w) ** 2 if i == k else 0.0 for k in range(len(width))] for i, w in enumerate(width)]
        (tmp_path / "fit.json").write_text(
            json.dumps({"nonlinear": {**model, "covariance": {"matrix": matrix}}, "linear": plain["linear"]})
        )
        words = ("--torque", "1", "--loops", "open-loop", "--plants", "5", "--no-replay")
        assert run(["couple", str(tmp_path / "fit.json"), "-o", str(tmp_path / "c.json"), "--force", *words]) == 0
        found = [one for one in eaid.load(tmp_path / "c.json").findings if one.code == "draws-rejected"]
        assert bool(found) is told and all(one.values["pct"] > 5 for one in found)
