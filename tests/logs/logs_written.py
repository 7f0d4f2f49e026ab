"""One step as text, as a DataFrame, and in every format that takes a library of its own, written by those libraries."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

RATE = 200
T = np.arange(300) / 100.0
U = np.where(T >= 1.0, 60.0, 0.0)
Y = np.round(np.where(T >= 1.0, -1.5 * np.expm1(-(T - 1.0) / 0.3), 0.0) + 0.01 * np.sin(50 * T), 6)


def frame(names: str, *values: Any, units: dict[str, str] | None = None) -> pd.DataFrame:
    """Columns under the names that stand between bars."""
    made = pd.DataFrame(dict(zip(names.split("|"), values, strict=True)))
    made.attrs["units"] = units or {}
    return made


def text(header: str | None, *columns: Any, between: str = ",", end: str = "\n") -> str:
    """A table whose cells are texts or numbers; the names of its header stand apart by commas."""
    rows = [between.join(x if isinstance(x, str) else f"{x:.15g}" for x in row) for row in zip(*columns, strict=True)]
    return end.join([*([header.replace(",", between)] if header else []), *rows]) + end


def later(write: Callable[..., Any]) -> Callable[..., Callable[[Path], Any]]:
    """A function that writes a file, called now with all but its path."""
    return lambda *what, **how: lambda path: write(path, *what, **how)


@later
def changed(path: Path, write: Callable[[Path], Any], change: Callable[[bytearray], Any]) -> None:
    """A file of which some bytes are changed."""
    write(path)
    data = bytearray(path.read_bytes())
    change(data)
    path.write_bytes(data)


def step(count: int = 600) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time [s], duty [%] and torque [N·m] of one step at 1 s; numbers with all their digits."""
    t = np.arange(count) / RATE
    duty = np.where(t >= 1, 60.0, 0.0)
    torque = np.where(t >= 1, 2.0 * -np.expm1(-(t - 1) / 0.3), 0.0) + 1e-3 * np.sin(1e4 * t)
    return t, duty, torque


def tdms_of(path: Path, *channels: tuple[str, str, Any, dict[str, Any]]) -> Path:
    """Channels by group, name, values and properties."""
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(str(path)) as file:
        file.write_segment([ChannelObject(*channel) for channel in channels])
    return path


def tdms(path: Path, t: Any, duty: Any, torque: Any) -> Path:
    """Two waveform channels, torque in mN·m."""
    rate = {"wf_increment": round(float(t[1] - t[0]), 9), "wf_start_offset": float(t[0]), "wf_samples": len(t)}
    duty_, torque_ = (rate | {"unit_string": unit} for unit in ("%", "mN·m"))
    return tdms_of(path, ("Log", "Duty", duty, duty_), ("Log", "Torque", torque * 1e3, torque_))
