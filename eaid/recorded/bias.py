"""What the noise in a loop's duty does to a direct fit: refits on simulated loops like the recorded one."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eaid.arrays import Array
from eaid.findings import Finding, finding
from eaid.recorded.law import Law, simulated
from eaid.recorded.log import RecordedLog
from eaid.recorded.solve import Solved, refit
from eaid.results.recorded import Bias


def like_residuals(r: Array, draw: np.random.Generator) -> Array:
    """Noise of the residuals' own spectrum, with phases of its own, (n,)."""
    spectrum = np.fft.rfft(r)
    turned = np.abs(spectrum) * np.exp(2j * np.pi * draw.uniform(size=len(spectrum)))
    return np.asarray(np.fft.irfft(turned, len(r)))


@dataclass(frozen=True, eq=False)
class CurveBias:
    """Size of the mean error of the refits in log T_s, log τ1, log τ2, (3, L), chance taken off, at inputs (L,)."""

    duty: Array
    off: Array
    mean: Bias


def bias_of(base: Solved, laws: Sequence[Law | None], refits: int, seed: int) -> CurveBias:
    """Refits on simulated logs of the same loops: their mean error and their scatter."""
    draw = np.random.default_rng(seed)
    model, logs = base.setup.model, [one.log for one in base.setup.copies]
    used = np.concatenate([log.input[log.input > 0] for log in logs[: len(laws)]])
    low, high = np.clip(np.quantile(used, [0.1, 0.9]), model.low, model.high).tolist()
    shown = np.linspace(low, high, 11)
    truth = _logs_of_curves(base, shown)
    rows = []
    for _ in range(refits):
        again: list[RecordedLog] = []
        for k, log in enumerate(logs):
            noise = like_residuals(base.missed[k], draw)
            law = laws[k] if k < len(laws) else None
            if law is not None and log.starts_idle and len(noise) == len(log.input):
                again.append(simulated(base, k, log, law, noise))
                continue
            output, counted = log.output.copy(), base.setup.drives[k].w > 0
            output[counted] += base.missed[k] + noise
            again.append(replace(log, output=output))
        rows.append(_logs_of_curves(refit(base, again), shown) - truth)
    errors = np.array(rows)
    mean, sd = errors.mean(axis=0), errors.std(axis=0, ddof=1) if refits > 1 else np.zeros_like(errors[0])
    off = [100 * float(np.sqrt(np.mean(one**2))) for one in mean]
    wide = [100 * float(np.sqrt(np.mean(one**2))) for one in sd]
    beyond_chance = np.sqrt(np.maximum(mean**2 - sd**2 / refits, 0.0))
    return CurveBias(shown, beyond_chance, Bias(refits, off[0], off[1], off[2], wide[0], wide[1], wide[2]))


def _logs_of_curves(solved: Solved, duty: Array) -> Array:
    """log T_s, log τ1, log τ2, (3, L)."""
    tables = solved.curves(duty)
    return np.asarray(np.log(np.maximum(np.array([tables.steady, tables.tau1, tables.tau2]), 1e-9)))


def bias_finding(bias: Bias) -> Finding:
    """Whether the bias is more than chance and than half a percent."""
    pairs = (
        (bias.Ts_pct, bias.scatter_Ts_pct),
        (bias.tau1_pct, bias.scatter_tau1_pct),
        (bias.tau2_pct, bias.scatter_tau2_pct),
    )
    few = max(bias.refits, 1) ** 0.5
    beyond = any(off is not None and sd is not None and off > max(0.5, 3 * sd / few) for off, sd in pairs)
    return finding(
        "loop-bias" if beyond else "loop-bias-small", "nonlinear",
        refits=bias.refits, Ts_pct=bias.Ts_pct, tau1_pct=bias.tau1_pct, tau2_pct=bias.tau2_pct,
    )  # fmt: skip
