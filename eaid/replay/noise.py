"""Noise on the output as the residuals of the fit have it.

A run's residuals from its level's own curve (`friction` in fit.json) are taken as white noise plus a first-order
autoregression φ^k that holds the share s of the power. Two numbers of `uncertainty.adequacy` fix both: the first
autocorrelation ρ1 = s φ, and the effective sample size n_e = n / (1 + 2 Σ ρ) = n / (1 + 2 s φ/(1 − φ)), so that

    φ = 1 − 2 ρ1/(n/n_e − 1),    s = ρ1/φ,    memory = −dt/ln φ

The fit sees means of repeats; one run is noisier by the root of their number. What of it is torque that is really
there, and what the sensor adds, residuals cannot tell: all of it is put on the measured torque.
"""

import math
from dataclasses import replace

from eaid.errors import DataError
from eaid.options import Rig
from eaid.results.fit import Fit


def with_residual_noise(rig: Rig, fit: Fit) -> Rig:
    """The rig with noise as the residuals of a fit have it; DataError where the fit has none."""
    adequacy = fit.uncertainty.adequacy if fit.uncertainty is not None else None
    levels = fit.friction_levels
    rows = [(row.sse, row.rmse) for row in levels if row.sse is not None and row.rmse is not None]
    first = adequacy.residual_autocorrelation if adequacy is not None else None
    effective = adequacy.effective_samples if adequacy is not None else None
    rate_hz, sources = fit.data.sample_rate_hz, fit.data.sources
    if first is None or not effective or rate_hz is None or not rows or not sources:
        raise DataError(
            "the fit does not say how its residuals are coloured; fit again with «ci» robust, or give «noise_nm»"
        )
    counts = {source.level for source in sources}
    samples = sum(sse / rmse**2 for sse, rmse in rows if rmse > 0)
    if samples <= 0:
        raise DataError("the fit's residuals are zero; there is no noise to take from them")
    repeats = len(sources) / len(counts)
    size = math.sqrt(repeats * sum(sse for sse, _ in rows) / samples)
    surplus = samples / effective - 1
    memory = 1 - 2 * first / surplus if first > 0 and surplus > 0 else 0.0
    # Too short a tail for this first autocorrelation: one process, s = 1.
    if memory <= first:
        memory = first
    if memory <= 0:
        return replace(rig, noise_nm=size, noise_correlation_s=0.0, noise_coloured_share=1.0)
    correlation_s = -1 / (rate_hz * math.log(memory))
    return replace(rig, noise_nm=size, noise_correlation_s=correlation_s, noise_coloured_share=first / memory)
