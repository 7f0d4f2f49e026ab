"""Result files: what is written is read back; what is wrong is refused by name; what is absent costs its part only."""

import json
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lsim

import eaid
from eaid.errors import DataError

Run = Callable[..., Any]


def written(folder, content):
    path = folder / "fit.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return path


@pytest.mark.parametrize("which", [0, 1])
def test_written_and_read_back_and_the_same_bytes_again(which, small_files, tmp_path):
    path = small_files[which]
    back = eaid.load(path)
    back.save(tmp_path / path.name)
    assert (tmp_path / path.name).read_bytes() == path.read_bytes()
    content = json.loads(path.read_text(encoding="utf-8"))
    assert list(content)[:3] == ["schema", "eaid", "digest"]
    assert [one["code"] for one in content["findings"]] == [one.code for one in back.findings]
    parts = [content, *(content[name] for name in ("friction", "nonlinear", "linear") if name in content)]
    texts = [text for part in parts for text in part["warnings"]]
    assert sorted(texts) == sorted(one["text"] for one in content["findings"])
    with pytest.raises(AttributeError):
        back.seed = 3


def test_what_is_absent_is_left_out_and_what_is_not_known_is_null(tmp_path):
    fit = eaid.load(written(tmp_path, {"linear": {"a0": 1.5, "b0": 0.08, "c0": -1.0, "rmse": None}}))
    assert fit.nonlinear is None and fit.linear.a0 == 1.5
    fit.save(tmp_path / "again.json")
    content = json.loads((tmp_path / "again.json").read_text(encoding="utf-8"))
    assert "nonlinear" not in content and content["linear"]["rmse"] is None


def test_a_changed_digit_is_refused_and_another_layout_is_told(small_files, tmp_path, run_eaid):
    text = small_files[0].read_text(encoding="utf-8")
    with pytest.raises(DataError, match="is damaged, or was changed after eaid wrote it"):
        eaid.load(written(tmp_path, re.sub(r'("b0": 0\.\d+)\d', r"\g<1>", text, count=1)))
    path = written(tmp_path, {**json.loads(text), "seed": 3})
    assert eaid.load(path).seed == 3
    assert "fit.json" in run_eaid("tune-rc", path, "-o", tmp_path / "gains.json").err


LINEAR = {"a0": 1.5, "b0": 0.1, "c0": 1.0}
REFUSED: dict[str, tuple[Any, str]] = {
    "no number": ({"linear": LINEAR | {"a0": "x"}}, 'its linear.a0 is "x"'),
    "a number beyond reason": ({"linear": LINEAR | {"a0": 1e70}}, "its linear.a0 is 1e+70"),
    "a list for a model": ({"linear": [1]}, "its linear is [1]"),
    "a time constant of 0": ({"release": {"tau1": 0.0, "tau2": 1.0}}, "its release.tau1 is 0.0"),
    "a rig inside out": (
        {"data": {"apparatus": {"inner_radius_m": 0.07}}}, "an inner radius of 0.07 m and an outer one of 0.06 m"),
    "no such kind": ({"data": {"kind": "brake"}}, 'its data.kind is "brake"'),
    "nothing": ("", "is not a JSON file"),
    "a list": ("[]", "is no result of eaid"),
    "an empty object": ("{}", "is no result of eaid"),
    "gains without a model": ('{"schema": "eaid/gains/1"}', "has no model"),
    "nested without end": ("{" * 5000, "is not a JSON file"),
    "NaN": ('{"linear": {"a0": NaN}}', "it holds NaN, which is no finite number"),
    "a plan": ('{"schema": "eaid/plan/1"}', "is a plan.json"),
    "another schema": ('{"schema": "eaid/fit/99"}', "make it again with this version"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_a_file_that_is_refused(case, tmp_path, run_eaid):
    content, said = REFUSED[case]
    path = written(tmp_path, content)
    with pytest.raises(DataError) as refused:
        eaid.load(path)
    assert said in str(refused.value) and str(path) in str(refused.value)
    assert run_eaid("tune-rc", path, "-o", tmp_path / "gains.json").code == 3


def test_what_is_absent_costs_its_part_only(tmp_path, run_eaid):
    levels = [{"level": 10}, {"level": 20, "Ts": 1, "tau1": 0.1, "tau2": 2}]
    content = {"linear": {"a0": 1, "b0": 0.1, "c0": None}, "friction": {"levels": levels, "trends": []},
               "nonlinear": "", "seed": None}  # fmt: skip
    path = written(tmp_path, content)
    fit = eaid.load(path)
    assert fit.linear is None and [row.level for row in fit.friction.levels] == [20.0]
    told = run_eaid("report", path, "-o", tmp_path / "report").err
    assert "its friction.levels[0] has no Ts and is left out" in told and "its linear has no c0 and is left out" in told


def test_a_plant_of_another_kind_is_known_by_its_own_numbers():
    """A mass on a spring by SciPy, 3/(s² + 0.6 s + 1): gain 3, ω 1, ζ 0.3, at every input."""
    t, logs, rng = np.arange(0.0, 30.0, 0.05), {}, np.random.default_rng(5)
    for u in (2.0, 5.0, 8.0):
        for k in range(2):
            held = (t >= 2) * u
            y = lsim(([3.0], [1.0, 0.6, 1.0]), held, t, interp=False)[1] + 0.01 * rng.standard_normal(len(t))
            logs[f"u{u:g}_{k}"] = pd.DataFrame({"time_s": t, "duty_pct": held, "torque_nm": y})
    fit = eaid.fit(logs)
    wanted = {"gain": 3.0, "omega": 1.0, "zeta": 0.3}
    assert dict(fit.params.xs("plant")) == pytest.approx(wanted, rel=0.01)
    assert (fit.conf_int().loc["plant"].T > 0).all().all()
    for level in (5.0, 6.0):  # recorded, and between two
        at = fit.at(level)
        assert at["value"].to_dict() == pytest.approx({"Ts": 3 * level, "omega": 1.0, "zeta": 0.3}, rel=0.01)
        assert (at["low"] < at["value"]).all() and (at["value"] < at["high"]).all()
    with pytest.raises(eaid.UsageError, match="level= 9: the fit knows 2 … 8 % only"):
        fit.at(9)
