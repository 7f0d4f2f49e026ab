"""Logs and options that the steps refuse, each with its sentence."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eaid
from eaid.errors import DataError, UsageError

from .make import log, read, without_input

RUN = log([(0.0, 4.0), (50.0, 8.0)])
BLIND = without_input(RUN)
LATER = RUN.assign(time_s=RUN.time_s + 1e4)
NAMED = {"name_pattern": "u{level}"}
REFUSED: dict[str, tuple[Any, dict[str, Any], str]] = {
    "units of inputs": (
        [RUN, log([(0, 4), (50, 8)], "V")], {}, 'different input units (%, V); say one with units="input=UNIT"'),
    "units of outputs": (
        [RUN, RUN.rename(columns={"torque_nm": "force_n"})], {},
        'different output units (N, N·m); say one with units="output=UNIT"'),
    "experiments": (
        [RUN, log([(0, 4), (50, 8)], "N")], {},
        "different experiments (clutch, friction-force); give one, or say kind="),
    "no level": ({"a": BLIND}, {}, "a: nothing tells its level; give the input column, or name_pattern= with {level}"),
    "no level, though an instant": ({"a": BLIND}, {"step_at": 4.0}, "nothing tells its level"),
    "just before the begin": (LATER, {"step_at": 1e4 - 1e-4}, "lies outside the log"),
    "no step where it was said to be": (
        RUN, {"step_at": 1.0, "until": 3.0}, "its input is at rest from 1 s on, where its step was said to be"),
    "no window": (
        {"u50": BLIND}, NAMED | {"step_at": 4.0, "until": 4.0},
        "the window ends (4 s) before it begins (4 s); mend until="),
    "a window before the log": (RUN, {"until": -3.0}, "the window ends at -3 s, before the log has begun; mend until="),
    "a touch alone": ({"u50": BLIND.assign(torque_nm=np.where(RUN.index < 1, 0.0, 1.0))}, NAMED, "no step stands out"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_a_log_that_is_refused(case: str) -> None:
    logs, options, sentence = REFUSED[case]
    with pytest.raises((DataError, UsageError)) as refused:
        read(logs, **options)
    assert sentence in str(refused.value)


def test_two_rigs_are_not_fitted_together(tmp_path: Path) -> None:
    for surfaces in (1, 2):
        made = {f"u{surfaces}": log([(0, 4), (50, 8)], noise=0.01, seed=surfaces)}
        read(made, apparatus=f"surfaces={surfaces}").save(tmp_path / f"{surfaces}.h5")
    with pytest.raises(DataError, match="the datasets are of different rigs; fit them apart"):
        eaid.read(tmp_path)
    assert eaid.read(tmp_path, apparatus="surfaces=2").apparatus.surfaces == 2


def test_a_set_of_averages_alone_is_not_saved(small_steps: "eaid.StepSet", tmp_path: Path) -> None:
    with pytest.raises(DataError, match="holds averaged levels only; save the one that was read from logs"):
        replace(small_steps, steps=()).save(tmp_path / "a.h5")
    assert replace(small_steps, runs=()).to_frame().empty
