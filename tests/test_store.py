"""Result files: what is not finite is null, wrong files are refused by name."""

import json
from pathlib import Path

import numpy as np
import pytest

from eaid.errors import DataError
from eaid.store import dumps, read_json, stamped, write_json


def test_arrays_scalars_and_non_finite_values_become_json() -> None:
    text = dumps({"a": np.array([1.0, np.nan]), "b": np.float64(0.1), "c": (np.int64(3), float("inf")), 4: True})
    assert json.loads(text) == {"a": [1.0, None], "b": 0.1, "c": [3, None], "4": True}


def test_a_result_returns_as_it_was_written(tmp_path: Path) -> None:
    path = tmp_path / "fit.json"
    result = stamped("eaid/fit/1", {"linear": {"a0": 1.36}})
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
