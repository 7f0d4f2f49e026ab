"""`eaid couple`: its table, its file and its warnings."""

import json
from pathlib import Path


def test_the_table_and_the_file_agree(rig, run_eaid):
    words = "couple fit.json --gains gains.json --torque 1,2 --loops pi,rc-no-rate --wall 30 --no-replay"
    ran = run_eaid(words)
    walls = json.loads(Path("couple.json").read_text(encoding="utf-8"))["walls"]
    assert ran.code == 0 and [(wall["loop"], wall["torque_nm"]) for wall in walls] == [
        ("pi", 1.0), ("rc-no-rate", 1.0), ("pi", 2.0), ("rc-no-rate", 2.0),
    ]  # fmt: skip
    assert 0 < walls[0]["K_passive"] < 10 and f"{walls[0]['K_passive']:.3g}" in ran.out and "--" not in ran.out
    assert "warning: pi: a wall of 30 N·m/rad is beyond what stays stable" in ran.err
    assert "couple.json: 4 walls; next: eaid report fit.json gains.json couple.json" in ran.err
    brief = run_eaid(words.replace("--gains ", "") + " --force")  # the gains by their place
    assert json.loads(Path("couple.json").read_text(encoding="utf-8"))["walls"] == walls
    assert len((brief.out + brief.err).splitlines()) <= 25
    assert run_eaid(f"{words} gains.json").code == 2


def test_a_force_makes_walls_along_a_line_and_a_temperature_none(by_hand, run_eaid):
    data = {"kind": "clutch", "input_unit": "V", "levels": [30.0, 300.0], "sample_rate_hz": 1000.0}
    by_hand({"data": {**data, "output_unit": "N"}, "linear": None}, k=3)
    words = "couple fit.json --loops open-loop --torque 1 --no-replay --force"
    ran = run_eaid(words)
    assert ran.code == 0 and "stable (N/m)" in ran.out and "0.8 N·s/m" in ran.out and "rad" not in ran.out + ran.err
    assert run_eaid(f"{words} --encoder-counts 4096").code == 2
    by_hand({"data": {**data, "output_unit": "°C"}, "linear": None}, k=3)
    ran = run_eaid(words)
    assert ran.code == 3 and "a torque in N·m or a force in N, and the fit's output is in °C" in ran.err


def test_one_level_tells_no_wall(by_hand, run_eaid):
    """It once asked for another torque than the one that it had chosen."""
    model = json.loads(Path("fit.json").read_text())["nonlinear"]
    by_hand({"nonlinear": {**model, "u_range": [60.0, 60.0]}, "plant": None})
    ran = run_eaid("couple fit.json --loops open-loop --no-replay --force")
    assert ran.code == 2 and "the fit knows one level only" in ran.err


def test_how_many_draws_the_constraints_cut_away_is_told(by_hand, run_eaid):
    model = json.loads(Path("fit.json").read_text())["nonlinear"]
    # the covariance is that of coefficients over the input in hundreds
    width = [2.0 * abs(c) * 100.0**k for part in ("tau1", "tau2", "Ts") for k, c in enumerate(model[part])]
    for scale, told in ((0.5, True), (1e-4, False)):
        matrix = [[(scale * w) ** 2 if i == k else 0.0 for k in range(len(width))] for i, w in enumerate(width)]
        by_hand({"nonlinear": {**model, "covariance": {"matrix": matrix}}})
        words = "simulate fit.json --controller open-loop --duration 3 --plants 5 -o r.h5 --force --json"
        found = [one for one in json.loads(run_eaid(words).out)["findings"] if one["code"] == "draws-rejected"]
        assert bool(found) is told and all(one["values"]["pct"] > 5 for one in found)
