"""The response of the two-state model in plain Python: what `kernel` is held to, real or complex."""

from typing import Any

import numpy as np

from eaid.recorded.drive import Drive
from eaid.recorded.model import Tables


def response(drive: Drive, tables: Tables, scalars: Any, start: tuple[Any, Any] = (0.0, 0.0)) -> Any:
    """Idle output and both states together at every row, shape (n,); complex where an argument is.

    `scalars` as in `kernel.rows`; which way a state moves is told by real parts.
    """
    share, rest1, rest2, fall1, fall2, excess, idle = scalars[:7]
    x1, x2 = start
    found = []
    for i, step, up in zip(drive.index, drive.dt_s, drive.rising, strict=True):
        found.append(idle + x1 + x2)
        if step <= 0:
            continue
        total = tables.steady[i] * ((1 + excess) if up < 0 else 1)
        x1 = _moved(x1, share * total, tables.tau1[i], rest1, fall1, tables.rest[i], step)
        x2 = _moved(x2, total - share * total, tables.tau2[i], rest2, fall2, tables.rest[i], step)
    return np.array(found)


def _moved(x: Any, target: Any, tau: Any, at_rest: Any, factor: Any, rest: float, step: float) -> Any:
    if np.real(target) < np.real(x):
        if rest >= 1:
            tau = tau * factor
        elif np.real(at_rest) > 0:
            tau = rest * tau + (1 - rest) * at_rest
    return x + (1 - np.exp(-step / tau)) * (target - x)
