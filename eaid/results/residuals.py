"""What is left in residuals e of n samples: how they go with their own past, and with the input u.

    a_k = Σ e_t e_t+k / Σ e²                            95 % band of white noise  ± 1.96 √(1/n)
    c_k = Σ (u_t − ū) e_t+k / √(Σ (u − ū)² Σ e²)        of residuals as they are  ± 1.96 √(Σ_k a_k b_k / n)

with b_k the input's own correlation (Bartlett). Lags are spread evenly over a tenth of the record, so that slow misfits
show, not the sensor's noise alone; by chance one in twenty lies outside.
"""

from collections.abc import Sequence

import numpy as np

from eaid.arrays import Array, means_of
from eaid.results.common import Number, Result

CORRELATION_LAGS, PART_OF_RECORD = 40, 10  # So many lags, the longest this part of the record
MOST_SHOWN_ROWS = 1_000_000  # Of a record; a longer one by the means of some


class Correlation(Result, frozen=True):
    """Correlations of the residuals of one model, by lag."""

    lag_s: tuple[Number, ...] = ()
    own: tuple[Number, ...] = ()
    """With themselves, a lag later."""
    band: Number = 0.0
    with_input: tuple[Number, ...] = ()
    """With the input, a lag before; empty where that is constant."""
    input_band: Number = 0.0

    def outside(self) -> tuple[int | None, int | None]:
        """Lags at which they go with their own past, and with the input, beyond the band; None: not known."""
        rows = ((self.own, self.band), (self.with_input, self.input_band))
        own, by_input = (sum(abs(one) > band for one in each) if each else None for each, band in rows)
        return own, by_input


def correlation_of(parts: Sequence[Array], dt_s: float, u: Array | None = None) -> Correlation:
    """Correlation of residuals, of several records each with itself; with an input where there is one record."""
    if (rows := max(map(len, parts)) // MOST_SHOWN_ROWS) > 1:
        u = None if u is None else means_of(u, rows)
        return correlation_of([means_of(e, rows) for e in parts if len(e) >= rows], rows * dt_s, u)
    n, squares = sum(map(len, parts)), sum(float(e @ e) for e in parts)
    longest = max(min(map(len, parts)) // PART_OF_RECORD, 1)
    lags = np.unique(np.linspace(1, longest, CORRELATION_LAGS).round().astype(int))
    if not squares > 0 or n <= 2 * CORRELATION_LAGS:
        return Correlation()
    own = [sum(float(e[:-k] @ e[k:]) for e in parts) / squares for k in lags]
    found = Correlation(_short(lags * dt_s), _short(own), 1.96 / n**0.5)
    if u is None or len(parts) != 1 or not np.ptp(u) > 0:
        return found
    (e,), off = parts, u - u.mean()
    size = float(np.sqrt(squares * (off @ off)))
    past = [float(off[: n - k] @ e[k:]) / size for k in lags]
    powers = [np.abs(np.fft.rfft(x, 2 * n)) ** 2 for x in (e, off)]
    alike = float(np.fft.irfft(powers[0] * powers[1])[0]) / size**2  # Parseval: the sum of a_k b_k over all lags
    return Correlation(found.lag_s, found.own, found.band, _short(past), 1.96 * (alike / n) ** 0.5)


def _short(values: Sequence[float] | Array) -> tuple[float, ...]:
    return tuple(float(f"{one:.4g}") for one in values)
