"""Every metric over the plants that the fit's data allow, the band of the torque, and each metric's worst plant.

A band is the quantiles over the plants, instant by instant (numpy's linear interpolation), at no more than 1,000
instants. Worst means largest; for the gain of a tone, farthest from 0 dB; for a phase, farthest from 0°; "never" (a
step that does not settle) is worse than any number. Mean, quantiles and standard deviation are over the plants that
have the number; `never` counts the others.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from eaid.arrays import Array
from eaid.models.parameters import Nonlinear
from eaid.replay.controllers import Controller
from eaid.replay.loop import Trace
from eaid.replay.many import replay_many
from eaid.replay.plant import plant_parameters
from eaid.replay.references import Reference
from eaid.replay.rig import Rig
from eaid.replay.scenarios import measure
from eaid.results.gain_checks import Tracking
from eaid.results.metrics import Distribution, Metrics, PlantSpread, Worst

QUANTILES = (0.0, 0.025, 0.25, 0.5, 0.75, 0.975, 1.0)
BAND_INSTANTS = 1000
GIVEN = ("from_nm", "to_nm", "frequency_hz")
"""What a measurement repeats from its reference; no metric."""


@dataclass(frozen=True, eq=False)
class Spread:
    """One controller over N plants."""

    values: Mapping[str, Array]
    """Metric → its value for each plant, shape (N,); NaN where it is never reached."""
    band_time_s: Array
    """Instants of the band [s], shape (m,)."""
    band_nm: Array
    """Torque at `QUANTILES` over the plants [N·m], shape (7, m)."""

    def summary(self, plants: Sequence[Nonlinear]) -> PlantSpread:
        """Of each metric its distribution, and the worst plant with its parameters."""
        return PlantSpread(len(plants), {name: _summary(name, values, plants) for name, values in self.values.items()})


def montecarlo(
    plants: Sequence[Nonlinear],
    controller: Controller,
    reference: Reference,
    rig: Rig,
    seed: int = 0,
    threads: int | None = None,
    tick: Callable[[], None] = lambda: None,
) -> Spread:
    """Trace a controller on every plant and measure each; `tick` is called once a plant."""
    n = len(reference.torque_nm)
    stride = -(-n // BAND_INSTANTS)
    kept = np.empty((len(range(0, n, stride)), len(plants)))
    measured: dict[int, dict[str, float]] = {}
    time_s: Array = np.arange(n, dtype=np.float64) * reference.dt_s
    limits = controller.on(rig).limits_pct

    def visit(index: int, torque: Array, duty: Array) -> None:
        kept[:, index] = torque[::stride]
        done = Trace(controller.name, reference.dt_s, time_s, reference.torque_nm, torque, duty, limits)
        measured[index] = dict(flattened(measure(done, reference)))
        tick()

    flat = [plant_parameters(p) for p in plants]
    replay_many(flat, controller, reference.torque_nm, rig, reference.dt_s, visit, seed, threads)
    values = {name: np.array([measured[i][name] for i in range(len(plants))]) for name in measured[0]}
    return Spread(values, time_s[::stride], np.quantile(kept, QUANTILES, axis=1))


def flattened(measured: Metrics) -> Iterator[tuple[str, float]]:
    """Metrics as name and number: `steps[3].overshoot_pct`, `frequencies[0.2 Hz].gain_db`; NaN for never."""
    named: list[tuple[str, msgspec.Struct, tuple[str, ...]]] = [("", measured, Tracking.__struct_fields__)]
    named += [(f"steps[{k}].", step, step.__struct_fields__) for k, step in enumerate(measured.steps, 1)]
    tones = measured.frequencies
    named += [(f"frequencies[{tone.frequency_hz:g} Hz].", tone, tone.__struct_fields__) for tone in tones]
    for prefix, part, names in named:
        for name in names:
            if name not in GIVEN:
                value = getattr(part, name)
                yield prefix + name, float("nan") if value is None else float(value)


def _summary(name: str, values: Array, plants: Sequence[Nonlinear]) -> Distribution:
    reached = values[np.isfinite(values)]
    signed = name.endswith(("gain_db", "phase_deg"))
    worst = int(np.argmax(np.where(np.isfinite(values), np.abs(values) if signed else values, np.inf)))
    plant = plants[worst]
    low, middle, high = np.quantile(reached, (0.025, 0.5, 0.975)).tolist() if len(reached) else (None,) * 3
    value = float(values[worst]) if np.isfinite(values[worst]) else None
    return Distribution(
        worst=Worst(value=value, plant=worst, tau1=plant.tau1, tau2=plant.tau2, Ts=plant.Ts),
        mean=float(reached.mean()) if len(reached) else None,
        sd=None if not len(reached) else float(reached.std(ddof=1)) if len(reached) > 1 else 0.0,
        low=low,
        median=middle,
        high=high,
        never=len(values) - len(reached),
    )
