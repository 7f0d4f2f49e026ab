"""Result files: what is not finite is null, wrong files are refused by name."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eaid.errors import DataError
from eaid.store import dumps, read_json, stamped, write_json


def test_arrays_scalars_and_non_finite_values_become_json() -> None:
    text = dumps({"a": np.array([1.0, np.nan]), "b": np.float64(0.1), "c": (np.int64(3), float("inf")), 4: True})
    assert json.loads(text) == {"a": [1.0, None], "b": 0.1, "c": [3, None], "4": True}


def test_a_result_returns_as_it_was_written(tmp_path: Path) -> None:
    path = tmp_path / "fit.json"
    result = stamped("eaid/fit/1", {"linear": {"a0": 1.36, "b0": 0.08, "c0": -2.42}})
    write_json(path, result)
    assert read_json(path, "fit") == result
    first = path.read_bytes()
    write_json(path, result, force=True)
    assert path.read_bytes() == first


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"{", "is not a JSON file"),
        (b"\xff\xfe", "is not a JSON file"),
        (b'{"schema": "eaid/fit/1", "a": ' + b"[" * 200_000 + b"]" * 200_000 + b"}", "is not a JSON file"),
        (b'{"schema": "eaid/fit/1", "a": ' + b"9" * 5000 + b"}", "is not a JSON file"),
        (b'{"schema": "eaid/fit/1", "a": NaN}', "it holds NaN, which is no JSON number"),
        (b'{"schema": "eaid/fit/1", "a": 1e999}', "it holds 1e999, which is no finite number"),
        (b"[]", "it holds no schema"),
        (b'{"schema": "eaid/gains/1"}', "its schema is 'eaid/gains/1'"),
        (b'{"schema": 7}', "it holds no schema"),
        (b'{"schema": "eaid/fit/1", "linear": [1, 2]}', r"its linear is \[1, 2\], not an object"),
        (b'{"schema": "eaid/fit/1", "linear": {"a0": "x"}}', r'its linear.a0 is "x", not a number'),
        (b'{"schema": "eaid/fit/1", "linear": {"a0": true}}', "its linear.a0 is true, not a number"),
        (
            b'{"schema": "eaid/fit/1", "nonlinear": {"tau1": null}}',
            "its nonlinear.tau1 is null, not a list of 3",
        ),
        (b'{"schema": "eaid/fit/1", "nonlinear": {"Ts": [1, 2, 3]}}', r"is \[1, 2, 3\], not a list of 4 numbers"),
        (b'{"schema": "eaid/fit/1", "friction": {"levels": 3}}', "its friction.levels is 3, not a list"),
    ],
)
def test_another_file_is_refused_in_a_sentence(tmp_path: Path, content: bytes, says: str) -> None:
    path = tmp_path / "fit.json"
    path.write_bytes(content)
    with pytest.raises(DataError, match=says) as refused:
        read_json(path, "fit")
    assert str(path) in str(refused.value)


def test_a_script_s_own_file_needs_no_schema_but_a_part_of_its_kind(tmp_path: Path) -> None:
    path = tmp_path / "own.json"
    path.write_text('{"linear": {"a0": 1.36, "b0": 0.08, "c0": -2.42}}')
    assert read_json(path, "fit")["linear"]["b0"] == 0.08
    with pytest.raises(DataError, match="is no eaid/gains/1 file"):
        read_json(path, "gains")


def test_a_missing_file_is_refused_in_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no such file"):
        read_json(tmp_path / "fit.json", "fit")


def test_what_is_absent_or_empty_is_left_to_its_users(tmp_path: Path) -> None:
    path = tmp_path / "fit.json"
    result = {"schema": "eaid/fit/1", "linear": None, "nonlinear": {}, "friction": {"C": 0.85}}
    path.write_text(json.dumps(result))
    assert read_json(path, "fit") == result


FIT = {
    "data": {"kind": "clutch", "levels": [20.0, 40.0]},
    "friction": {"levels": [{"level": 20.0, "Ts": 0.5, "tau1": 0.4, "tau2": 4.0}]},
    "linear": {"a0": 1.36, "b0": 0.08, "c0": -2.42, "bounds": {"B_m": 12.4, "B_M": 42.6}},
}


def written(tmp_path: Path) -> Path:
    path = tmp_path / "fit.json"
    write_json(path, stamped("eaid/fit/1", FIT))
    return path


def test_a_changed_digit_is_refused_with_what_to_do(tmp_path: Path) -> None:
    path = written(tmp_path)
    text = path.read_text()
    assert read_json(path, "fit") == stamped("eaid/fit/1", FIT)
    for digit, other in (("1.36", "1.37"), ('"clutch"', '"Clutch"'), ("-2.42", "2.42"), ("20.0", "20.5")):
        path.write_text(text.replace(digit, other, 1))
        with pytest.raises(DataError) as refused:
            read_json(path, "fit")
        assert refused.value.sentences == (
            f"{path}: is damaged, or was changed after eaid wrote it; make it again with eaid, "
            f"or delete its line digest if the change is yours",
        )
    lines = [line for line in path.read_text().splitlines(keepends=True) if '"digest"' not in line]
    path.write_text("".join(lines))
    assert read_json(path, "fit")["data"]["levels"] == [20.5, 40.0]


def test_every_damaged_byte_is_noticed(tmp_path: Path) -> None:
    """A bit turned anywhere: refused, or the same numbers; never other ones."""
    path = written(tmp_path)
    whole = path.read_bytes()
    truth = read_json(path, "fit")
    same = 0
    for place in range(len(whole)):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << (place % 8)
        path.write_bytes(damaged)
        told: list[str] = []
        try:
            found = read_json(path, "fit", told.append)
        except DataError:
            continue
        assert {key: found.get(key) for key in truth} == truth or told, (place, found)
        same += not told
    assert same < 0.25 * len(whole)  # white space and the key digest itself


def test_a_program_may_write_a_result_out_anew(tmp_path: Path) -> None:
    """The same content in another layout keeps its digest; other content is taken, and told."""
    path = written(tmp_path)
    content = json.loads(path.read_text())
    told: list[str] = []
    path.write_text(json.dumps(dict(reversed(content.items())), indent=4))
    assert read_json(path, "fit", told.append)["linear"] == FIT["linear"]
    assert told == []
    del content["linear"]["bounds"]
    path.write_text(json.dumps(content))
    assert "bounds" not in read_json(path, "fit", told.append)["linear"]
    assert told == [f"{path}: another program has written it anew: its digest no longer fits and is passed over"]


@pytest.mark.parametrize(
    ("fit", "says"),
    [
        ({"linear": {"a0": 1, "b0": 2}}, "its linear has no c0 and is left out"),
        ({"friction": {"levels": [{"level": None, "Ts": 1}]}}, "its friction.levels[0] has no level and is left out"),
        ({"friction": {"trends": {"Ts": {"form": "linear"}}}}, "its friction.trends.Ts has no coefficients"),
        ({"nonlinear": {"tau1": [1, 0, 0], "tau2": [1, 0, 0], "Ts": [0, 0, 0, 1]}}, "its nonlinear has no u_range"),
    ],
)
def test_a_part_without_what_it_needs_costs_that_part_alone(tmp_path: Path, fit: dict[str, Any], says: str) -> None:
    path = tmp_path / "fit.json"
    path.write_text(json.dumps({**fit, "release": {"tau1": 0.3, "tau2": 3.0}}))
    told: list[str] = []
    found = read_json(path, "fit", told.append)
    assert found["release"] == {"tau1": 0.3, "tau2": 3.0}
    assert len(told) == 1 and told[0].startswith(f"{path}: {says}")


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (
            {"friction": {"trends": {"Ts": {"form": "cubic", "coefficients": [1]}}}},
            'form is "cubic", not one of linear',
        ),
        ({"friction": {"trends": {"Ts": {"form": "linear", "coefficients": [1]}}}}, "has 1 coefficients, and a linear"),
        ({"friction": {"levels": [{"level": 1, "Ts": 1, "tau1": 0, "tau2": 1}]}}, "is 0, not a number above 0"),
        ({"friction": {"levels": [3]}}, r"its friction.levels\[0\] is 3, not an object"),
        ({"data": {"apparatus": {"surfaces": 1.5}}}, "is 1.5, not a whole number from 1 on"),
        ({"data": {"apparatus": {"inner_radius_m": 0.5}}}, "inner radius of 0.5 m and an outer one of 0.06"),
        ({"nonlinear": {"C": 1.5}}, "its nonlinear.C is 1.5, not a number from 0 on and at most 1"),
        ({"linear": {"a0": 1e70}}, r"its linear.a0 is 1e\+70, not a number"),
        ({"release": {"levels": [2]}}, r"its release.levels\[0\] is 2, not an object"),
        ({"linear": {"per_level": [{"ci95": {"B": [1, 2, 3]}}]}}, "not a list of 2 numbers"),
    ],
)
def test_what_stands_deep_inside_is_checked_too(tmp_path: Path, content: dict[str, Any], says: str) -> None:
    path = tmp_path / "fit.json"
    path.write_text(json.dumps(content))
    with pytest.raises(DataError, match=says):
        read_json(path, "fit")


def test_gains_are_checked_deep_inside(tmp_path: Path) -> None:
    path = tmp_path / "gains.json"
    path.write_text('{"rc": {"K_P": 4.5}, "margins": {"points": [{"rc": 3}]}}')
    with pytest.raises(DataError, match=r"its margins.points\[0\].rc is 3, not an object; make it again"):
        read_json(path, "gains")
