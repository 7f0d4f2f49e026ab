"""`--plants N`: every metric over the plants that the fit's data allow, the band of the torque, and the worst plant
of each metric.

A band is the quantiles over the plants, instant by instant (numpy's linear interpolation), at no more than 1,000
instants. Worst means
largest; for the gain of a tone, farthest from 0 dB; for a phase, farthest from 0°; "never" (a step that does not
settle) is worse than
any number. Mean, quantiles and standard deviation are over the plants that have the number; `never` counts the others.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from eaid.arrays import Array
from eaid.models.parameters import Nonlinear
from eaid.replay.controllers import Controller
from eaid.replay.loop import Replay
from eaid.replay.many import replay_many
from eaid.replay.plant import plant_parameters
from eaid.replay.references import Reference
from eaid.replay.rig import Rig
from eaid.replay.scenarios import measure

QUANTILES = (0.0, 0.025, 0.25, 0.5, 0.75, 0.975, 1.0)
BAND_INSTANTS = 1000
GIVEN = ("from_nm", "to_nm", "frequency_hz", "counted_from_s")
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

    def summary(self, plants: Sequence[Nonlinear]) -> dict[str, Any]:
        """JSON-able: of each metric its distribution, and the worst plant with its parameters."""
        return {name: _summary(name, values, plants) for name, values in self.values.items()}


def montecarlo(
    plants: Sequence[Nonlinear],
    controller: Controller,
    reference: Reference,
    rig: Rig,
    seed: int = 0,
    threads: int | None = None,
    tick: Callable[[], None] = lambda: None,
) -> Spread:
    """Replay a controller on every plant and measure each; `tick` is called once a plant."""
    n = len(reference.torque_nm)
    stride = -(-n // BAND_INSTANTS)
    kept = np.empty((len(plants), len(range(0, n, stride))))
    measured: list[dict[str, float]] = [{} for _ in plants]
    time_s: Array = np.arange(n, dtype=np.float64) * reference.dt_s
    acting = controller if rig.saturation else controller.without_limits()
    limits = (acting.gains.duty_min, acting.gains.duty_max)

    def visit(first: int, torques: Array, duties: Array) -> None:
        for index, (torque, duty) in enumerate(zip(torques.T.copy(), duties.T.copy(), strict=True), first):
            kept[index] = torque[::stride]
            done = Replay(controller.name, reference.dt_s, time_s, reference.torque_nm, torque, duty, limits)
            measured[index] = dict(flattened(measure(done, reference)))
            tick()

    replay_many(
        [plant_parameters(p) for p in plants],
        controller,
        reference.torque_nm,
        rig,
        reference.dt_s,
        visit,
        seed,
        threads,
    )
    values = {name: np.array([m[name] for m in measured]) for name in measured[0]}
    return Spread(values, time_s[::stride], np.asarray(np.quantile(kept, QUANTILES, axis=0), dtype=np.float64))


def flattened(measured: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, float]]:
    """Metrics as name and number: `steps[3].overshoot_pct`, `frequencies[0.2 Hz].gain_db`; NaN for never."""
    for name, value in measured.items():
        if isinstance(value, list):
            for k, part in enumerate(value, 1):
                place = f"{part['frequency_hz']:g} Hz" if "frequency_hz" in part else str(k)
                yield from flattened(part, f"{name}[{place}].")
        elif name not in GIVEN:
            yield prefix + name, float("nan") if value is None else float(value)


def _summary(name: str, values: Array, plants: Sequence[Nonlinear]) -> dict[str, Any]:
    reached = values[np.isfinite(values)]
    never = len(values) - len(reached)
    signed = name.endswith(("gain_db", "phase_deg"))
    worst = int(np.argmax(np.where(np.isfinite(values), np.abs(values) if signed else values, np.inf)))
    plant = plants[worst]
    result: dict[str, Any] = {"never": never} if never else {}
    if len(reached):
        low, middle, high = np.quantile(reached, (0.025, 0.5, 0.975))
        result |= {
            "mean": float(reached.mean()),
            "sd": float(reached.std(ddof=1)) if len(reached) > 1 else 0.0,
            "p2.5": float(low),
            "median": float(middle),
            "p97.5": float(high),
        }
    result["worst"] = {
        "value": float(values[worst]) if np.isfinite(values[worst]) else None,
        "plant": worst,
        "tau1": [float(value) for value in plant.tau1],
        "tau2": [float(value) for value in plant.tau2],
        "Ts": [float(value) for value in plant.Ts],
    }
    return result
