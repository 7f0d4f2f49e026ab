"""Noise as large and as coloured as the residuals of the fit.

A run's residuals from its level's own curve (`friction` in fit.json) are taken as white noise plus a first-order
autoregression φ^k that
holds the share s of the power. Two numbers of `uncertainty.adequacy` fix both: the first autocorrelation ρ1 = s φ,
and the effective sample
size n_e = n / (1 + 2 Σ ρ) = n / (1 + 2 s φ/(1 − φ)), so that

    φ = 1 − 2 ρ1/(n/n_e − 1),    s = ρ1/φ,    memory = −dt/ln φ

The fit sees means of repeats; one run is noisier by the root of their number. What of it is torque that is really
there, and what the
sensor adds, residuals cannot tell: all of it is put on the measured torque.
"""

import math
from collections import Counter
from typing import Any


def residual_noise(fitted: dict[str, Any]) -> dict[str, float] | str:
    """Settings of `Rig` (noise_nm, noise_correlation_s, noise_coloured_share) from a fit.json; a sentence where it
    does not hold them."""
    try:
        levels = fitted["friction"]["levels"]
        rows = [(float(level["sse"]), float(level["rmse"])) for level in levels]
        adequacy = fitted["uncertainty"]["adequacy"]
        first, effective = float(adequacy["residual_autocorrelation"]), float(adequacy["effective_samples"])
        rate_hz = float(fitted["data"]["sample_rate_hz"])
        sources = fitted["data"]["sources"]
        counts = Counter(float(source["level"]) for source in sources)
    except (KeyError, TypeError, ValueError):
        return "does not say how its residuals are coloured; fit again with --ci robust, or give --noise-nm"
    samples = sum(sse / rmse**2 for sse, rmse in rows if rmse > 0)
    if samples <= 0:
        return "its residuals are zero; there is no noise to take from them"
    repeats = len(sources) / len(counts)
    size = math.sqrt(repeats * sum(sse for sse, _ in rows) / samples)
    surplus = samples / effective - 1
    memory = 1 - 2 * first / surplus if first > 0 and surplus > 0 else 0.0
    # Too short a tail for this first autocorrelation: one process, s = 1.
    if memory <= first:
        memory = first
    if memory <= 0:
        return {"noise_nm": size, "noise_correlation_s": 0.0, "noise_coloured_share": 1.0}
    return {
        "noise_nm": size,
        "noise_correlation_s": -1 / (rate_hz * math.log(memory)),
        "noise_coloured_share": first / memory,
    }
