"""Logs by formula, as tables, and what is read out of them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

import eaid

INPUTS = {"%": "duty_pct", "V": "voltage_V", "N": "force_n", "RPM": "speed_rpm"}
Plan = Sequence[tuple[float, float]]


def curve(t_s: Any, tau1: float = 0.2, tau2: float = 1.0, share: float = 0.85) -> Any:
    """Eq. (4) for a unit step at 0; 0 before it."""
    t = np.maximum(t_s, 0.0)
    return share * -np.expm1(-t / tau1) + (1 - share) * -np.expm1(-t / tau2)


def log(
    plan: Plan, unit: str = "%", rate_hz: float = 100.0, gain: float = 0.04, start_s: float = 0.0,
    offset: float = 0.0, noise: float = 0.0, seed: int = 0, tau1: float = 0.2, tau2: float = 1.0,
) -> pd.DataFrame:  # fmt: skip
    """A log that holds each (input, seconds) of the plan in turn, on a plant that is linear in the input."""
    counts = [round(seconds * rate_hz) for _, seconds in plan]
    u = np.repeat([float(level) for level, _ in plan], counts)
    t, y, before, at = np.arange(len(u)) / rate_hz, np.full(len(u), offset), 0.0, 0
    for (level, _), count in zip(plan, counts, strict=True):
        y[at:] += gain * (level - before) * curve(t[: len(t) - at], tau1, tau2)
        before, at = level, at + count
    y += noise * np.random.default_rng(seed).normal(size=len(y))
    return pd.DataFrame({"time_s": t + start_s, INPUTS[unit]: u, "torque_nm": y})


def with_input(frame: pd.DataFrame, values: Any, **samples: float) -> pd.DataFrame:
    """The same log with another input column."""
    return frame.assign(**{str(frame.columns[1]): values})


def without_input(frame: pd.DataFrame) -> pd.DataFrame:
    return frame[["time_s", "torque_nm"]]


def plus(frame: pd.DataFrame, change: Any) -> pd.DataFrame:
    """The same log with something added to its output."""
    return frame.assign(torque_nm=frame["torque_nm"] + change)


def white(count: int, size: float, seed: int = 0) -> Any:
    return size * np.random.default_rng(seed).normal(size=count)


def read(logs: Any, **options: Any) -> "eaid.StepSet":
    """The steps of one table, named a, of several, a, b, …, or of tables by name."""
    if isinstance(logs, pd.DataFrame):
        logs = {"a": logs}
    elif not isinstance(logs, Mapping):
        logs = dict(zip("abcdefghij", logs, strict=False))
    return eaid.read(logs, logs_as="steps", **options)


def told(steps: "eaid.StepSet") -> list[str]:
    """The codes of all findings: those of the set, then those of each run."""
    return [one.code for one in (*steps.findings, *(one for run in steps.runs for one in run.findings))]


def values(steps: "eaid.StepSet", code: str, name: str | None = None) -> dict[str, Any]:
    """The values of the only finding of a code, of one run or of all."""
    runs = [run.findings for run in steps.runs if name in (None, run.name)]
    (found,) = (one for findings in (steps.findings, *runs) for one in findings if one.code == code)
    return found.values
