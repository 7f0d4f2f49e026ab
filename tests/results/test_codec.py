"""The codec: what is written is read back; what is wrong is refused by name; what is absent costs its part only."""

import json
import math
from pathlib import Path

import pytest

from eaid.errors import DataError
from eaid.findings import Finding
from eaid.results import codec
from eaid.results.fit import Fit, FittedData, Friction, FrictionLevel, Linear, Nonlinear, Release, Rig
from eaid.results.gains import PI, Gains, LinearModel

LINEAR = Linear(a0=1.5, b0=0.08, c0=-1.0, rmse=math.nan)
FIT = Fit(
    data=FittedData(levels=(10.0, 20.0)),
    friction=Friction(C=0.85, levels=(FrictionLevel(10.0, 0.1, 0.2, 4.0),)),
    linear=LINEAR,
    findings=(Finding("part-left-out", "caution", "linear", values={"part": "x", "key": "y"}),),
)


def test_written_and_read_back(tmp_path: Path):
    path = tmp_path / "fit.json"
    codec.write(path, FIT, "fit")
    back, found = codec.read(path, "fit", Fit)
    assert found == ()
    assert back.friction == FIT.friction
    assert back.findings == FIT.findings
    assert back.linear is not None
    assert back.linear.rmse is None  # what is not finite is null
    content = json.loads(path.read_text(encoding="utf-8"))
    assert list(content)[:3] == ["schema", "eaid", "digest"]
    assert "nonlinear" not in content  # a part that is absent
    assert content["linear"]["rmse"] is None  # a number that is not known
    assert content["linear"]["warnings"] == [content["findings"][0]["text"]]
    assert content["friction"]["levels"][0]["from"] == 0.0
    codec.write(path, back, "fit", force=True)
    first = path.read_bytes()
    codec.write(path, codec.read(path, "fit", Fit)[0], "fit", force=True)
    assert path.read_bytes() == first


def test_gains_back(tmp_path: Path):
    gains = Gains(LinearModel(1.0, 0.1, 0.0), pi=PI(21.0, 360.0))
    codec.write(tmp_path / "gains.json", gains, "gains")
    assert codec.read(tmp_path / "gains.json", "gains", Gains)[0] == gains


def test_a_changed_digit_is_refused_and_another_layout_is_told(tmp_path: Path):
    path = tmp_path / "fit.json"
    codec.write(path, FIT, "fit")
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace('"b0": 0.08', '"b0": 0.09'), encoding="utf-8")
    with pytest.raises(DataError, match="is damaged"):
        codec.read(path, "fit", Fit)
    path.write_text(json.dumps({**json.loads(text), "seed": 3}), encoding="utf-8")
    back, found = codec.read(path, "fit", Fit)
    assert (back.seed, [one.code for one in found]) == (3, ["result-written-anew"])


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"linear": {"a0": "x", "b0": 0.1, "c0": 1.0}}, "its linear.a0 is"),
        ({"linear": {"a0": 1e70, "b0": 0.1, "c0": 1.0}}, "its linear.a0 is 1e+70"),
        ({"linear": [1]}, "its linear is"),
        ({"release": {"tau1": 0.0, "tau2": 1.0}}, "its release.tau1 is 0.0"),
        ({"data": {"apparatus": {"inner_radius_m": 0.07}}}, "its data.apparatus is"),
        ({"data": {"kind": "brake"}}, "its data.kind is"),
    ],
)
def test_a_value_of_another_type_is_refused_by_name(content: dict[str, object], words: str):
    with pytest.raises(DataError) as told:
        codec.from_plain(content, Fit, "fit.json")
    assert words in str(told.value)


def test_what_is_absent_costs_its_part_only():
    found: list[Finding] = []
    content = {
        "linear": {"a0": 1, "b0": 0.1, "c0": None},
        "friction": {"levels": [{"level": 10}, {"level": 20, "Ts": 1, "tau1": 0.1, "tau2": 2}], "trends": []},
        "nonlinear": "",
        "seed": None,
    }
    fit = codec.from_plain(content, Fit, "fit.json", found)
    assert fit.linear is None
    assert fit.friction is not None
    assert [row.level for row in fit.friction.levels] == [20.0]
    assert [(one.code, one.values["part"], one.values["key"]) for one in found] == [
        ("part-left-out", "friction.levels[0]", "Ts"),
        ("part-left-out", "linear", "c0"),
    ]


def test_what_a_script_needs_to_write():
    content = {
        "nonlinear": {"C": 0.85, "tau1": [0.1, 0, 0], "tau2": [4, 0, 0], "Ts": [0, 0.04, 0, 0], "u_range": [10, 100]}
    }
    assert codec.from_plain(content, Fit, "fit.json").nonlinear == Nonlinear(
        tau1=(0.1, 0.0, 0.0), tau2=(4.0, 0.0, 0.0), Ts=(0.0, 0.04, 0.0, 0.0), u_range=(10.0, 100.0)
    )


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"schema": "eaid/gains/1"}', "{" * 5000, '{"linear": {"a0": NaN}}'])
def test_other_files_are_refused(tmp_path: Path, text: str):
    path = tmp_path / "fit.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(DataError, match=r"fit\.json"):
        codec.read(path, "fit", Fit)


def test_results_are_frozen():
    with pytest.raises(AttributeError):
        FIT.seed = 3  # type: ignore[misc]
    assert Release(0.2, 4.0) == Release(0.2, 4.0)
    with pytest.raises(ValueError, match="inner radius"):
        Rig(inner_radius_m=0.07)
