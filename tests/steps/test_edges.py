"""The edges of an output by itself: `eaid ingest --edges`, each log with its edges by hand."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

T = np.arange(3000) / 100
LN9, LN18 = float(np.log(9)), float(np.log(18))


def rise(at_s: float, tau: float, t: Any = T) -> Any:
    return -np.expm1(-np.maximum(t - at_s, 0.0) / tau)


def near(value: float, within: float) -> Any:
    return pytest.approx(value, abs=within)


WOUND_UP = 1.5 + 0.35 * (1 + np.tanh((14.5 - T) / 0.3)) - 0.75 * np.exp(-(((T - 15.5) / 0.5) ** 2))
"""From 2.2 down to 0.75 and back up to 1.5, as a loop whose integrator wound up: 107 % beyond its end."""
S = np.maximum(T - 6, 0.0)
SWINGS = 1 - np.exp(-S / 0.5) * np.cos(4 * S)
AT_PEAK = 0.2 * np.pi
NOISE = 0.01 * np.random.default_rng(0).normal(size=3000)
THREE = 0.5 + 2 * rise(5, 0.2) - rise(12, 0.4) + 2 * rise(20, 0.8)
STAIRS = np.select([T < 5, T < 12, T < 20], [0.0, 2.0, 1.0], 3.0)
BY_HAND = [
    {"before": near(a, 0.01), "after": near(b, 0.01),
     "rise_s": near(LN9 * tau, 0.03), "settling_s": near(LN18 * tau, 0.06)}
    for a, b, tau in ((0.5, 2.5, 0.2), (2.5, 1.5, 0.4), (1.5, 3.5, 0.8))
]  # fmt: skip
EDGES: dict[str, tuple[Any, Any, list[dict[str, Any]]]] = {
    "one": (rise(6, 0.4), None, [{
        "at_s": near(6.04, 0.1), "before": near(0, 0.01), "after": near(1, 0.01), "rise_s": near(0.4 * LN9, 0.1),
        "overshoot_pct": near(0, 1), "settling_s": near(0.4 * np.log(18), 0.15), "swings": 1}]),
    "three up": (sum(rise(at, 0.3) for at in (5.0, 15.0, 25.0)) + NOISE, None, [
        {"at_s": near(at, 0.2), "rise_s": near(0.66, 0.2)} for at in (5.0, 15.0, 25.0)]),
    "up and down": (rise(6, 0.3) - rise(18, 0.2), None, [
        {"at_s": near(6, 0.15), "after": near(1, 0.01)},
        {"at_s": near(18, 0.15), "before": near(1, 0.01), "after": near(0, 0.01), "rise_s": near(0.2 * LN9, 0.1)}]),
    "a little back": (rise(2, 0.1) - 0.1 * (T > 12), None, [{}]),
    "a fifth back": (rise(2, 0.1) - 0.22 * (T > 12), None, [{}, {"before": near(1, 0.01), "after": near(0.78, 0.01)}]),
    "most of it back": (rise(2, 0.1) - 0.6 * (T > 12), None, [{}, {}]),
    "slowly back is drift": (rise(2, 0.1) - 0.3 * np.clip((T - 10) / 20, 0, 1), None, [{}]),
    "swings": (SWINGS, None, [{
        "overshoot_pct": near(-100 * np.exp(-AT_PEAK / 0.5) * np.cos(4 * AT_PEAK), 3), "swings": 1,
        "after": near(1, 0.01), "settling_s": near(1.0, 0.1)}]),
    "wound up": (WOUND_UP, None, [{
        "before": near(2.2, 0.02), "after": near(1.5, 0.02), "overshoot_pct": near(107, 6), "swings": 2,
        "settling_s": near(15.5 + 0.5 * np.sqrt(np.log(0.75 / 0.035)) - 14.1, 0.15)}]),
    "wound up behind noise": (WOUND_UP + NOISE, None, [{"overshoot_pct": near(107, 6), "swings": 2}]),
    "a wave that never rests": (np.sin(2 * np.pi * T / 7.5), None, [{}] * 8),
    "noise": (NOISE, None, []),
    "three asked for": (THREE, STAIRS, BY_HAND),
    "in three parts each": (
        THREE, np.convolve(np.concatenate((np.zeros(2), STAIRS)), np.ones(3) / 3, "valid"), BY_HAND),
    "the last jump is no tenth": (THREE - 2 * rise(20, 0.8), np.where(T < 20, STAIRS, 1.15), BY_HAND[:2]),
    "it is a tenth": (THREE, np.where(T < 20, STAIRS, 1.25), BY_HAND),
    "a smooth reference asks for none": (rise(6, 0.4), np.sin(T), [{"before": near(0, 0.01)}]),
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("edges")
    for name, (output, reference, _) in EDGES.items():
        more = {} if reference is None else {"reference_nm": reference}
        frame = pd.DataFrame({"time_s": T, "torque_nm": output, **more})
        frame.to_csv(folder / f"{name}.csv", index=False)
    return folder


def test_edges(folder: Path, tmp_path: Path, run_eaid: Callable[..., Any]) -> None:
    ran = run_eaid("ingest", folder, "--edges", "--json", "-o", tmp_path / "a.h5")
    assert ran.code == 0, ran.err
    found = {log["run"]: log["edges"] for log in json.loads(ran.out)["logs"]}
    for name, (_, _, expected) in EDGES.items():
        assert len(found[name]) == len(expected), name
        for edge, numbers in zip(found[name], expected, strict=True):
            assert {key: edge[key] for key in numbers} == numbers, name


def test_the_table_of_edges(folder: Path, tmp_path: Path, run_eaid: Callable[..., Any]) -> None:
    ran = run_eaid("ingest", folder / "up and down.csv", "--edges", "-o", tmp_path / "a.h5")
    assert "2 edges of its output." in ran.out and "overshoot" in ran.out
    assert [line.split()[0] for line in ran.out.splitlines() if line.startswith(("6", "18", "17.9"))]
