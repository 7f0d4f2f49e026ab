from collections.abc import Callable

import numpy as np


def loop(
    wanted: np.ndarray, dt: float, gains: tuple[float, float], steady: Callable[[float], float],
    taus: tuple[Callable[[float], float] | float, ...], C: float = 0.85, noise: np.ndarray | float = 0.0,
    top: float = 100.0, dead_rows: int = 0,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Duty and measured output of a PI within limits, without wind-up, around two lags (one of C = 1) in parallel."""
    noise, duty, read = np.broadcast_to(noise, len(wanted)), np.zeros(len(wanted)), np.zeros(len(wanted))
    parts, x, integral = (C, 1 - C)[: len(taus)], [0.0] * len(taus), 0.0
    for k, reference in enumerate(wanted):
        read[k] = sum(x) + noise[k]
        asked = gains[0] * (reference - read[k]) + gains[1] * integral
        duty[k] = min(max(asked, 0.0), top)
        integral += dt * (reference - read[k]) * (asked == duty[k])
        u = duty[k - dead_rows] if k >= dead_rows else 0.0
        for i, (part, tau) in enumerate(zip(parts, taus, strict=True)):
            x[i] -= (part * steady(u) - x[i]) * np.expm1(-dt / (tau(u) if callable(tau) else tau))
    return duty, read
