"""Controllers on a reference: the guarantee watched, what no log showed, and drawn plants."""

from collections.abc import Mapping

import msgspec
import numpy as np

from eaid.errors import UsageError
from eaid.findings import Finding, finding
from eaid.limits import MOST_STEPS
from eaid.progress import Progress
from eaid.replay.guarantee_watch import watch
from eaid.replay.loop import replay
from eaid.replay.montecarlo import QUANTILES, montecarlo
from eaid.replay.plant import perturbed, plant_terms
from eaid.replay.references import Reference
from eaid.replay.scenarios import measure, record
from eaid.replay.setup import Setup
from eaid.results.gains import Gains
from eaid.results.replay import Head, Record
from eaid.uncertainty.draw import draw, drawable

UNSEEN = 0.01
"""Share of the samples that may lie outside what was identified without a word."""
Outcome = tuple[dict[str, Record], Head, list[Finding]]


def tracked(setup: Setup, wanted: Reference, gains: Gains | None, progress: Progress) -> Outcome:
    """Each controller on the reference; the guarantee watched along the robust one; and drawn plants."""
    options, records = setup.options, {}
    findings = _of_reference(setup, wanted, gains)
    for controller in setup.controllers:
        trace = replay(setup.plant, controller, wanted.torque_nm, setup.rig, wanted.dt_s, options.seed)
        metrics, columns = measure(trace, wanted), {}
        if controller.name == "rc":
            watched = watch(controller.gains, setup.plant, trace)
            metrics = watched.measured(metrics, wanted.begin)
            columns = {"chi_nm_s": watched.chi_nm_s, "rho_nm_s": watched.rho_nm_s}
        records[controller.name] = record(trace, metrics, columns)
    findings += _outside_identified(setup, records)
    head = Head("", dt_s=wanted.dt_s, counted_from_s=wanted.counted_from_s)
    if options.plants is not None:
        head, of_plants = _over_drawn_plants(setup, wanted, records, head, progress)
        findings += of_plants
    return records, head, findings


def _of_reference(setup: Setup, wanted: Reference, gains: Gains | None) -> list[Finding]:
    """Where a reference asks for more than the plant has, or is steeper than Q_M."""
    findings = []
    top, highest = float(wanted.torque_nm.max()), plant_terms(setup.plant, setup.plant.u_high)[2]
    if top > highest:
        findings.append(
            finding("reference-above-plant", "reference", asked=top, highest=highest, unit=setup.fit.data.output_unit)
        )
    Q_M = gains.rc.Q_M if gains is not None and gains.rc is not None else None
    if Q_M is not None and not wanted.steps and wanted.steepest_nm_s > Q_M * (1 + 1e-9):
        findings.append(finding("reference-above-q-max", "rc", slope=wanted.steepest_nm_s, Q_M=Q_M))
    return findings


def _outside_identified(setup: Setup, records: Mapping[str, Record]) -> list[Finding]:
    """Where replays go through what no log showed: duties outside the identified ones, falls between levels."""
    low, high = setup.known.plant.u_range
    below = above = falling = 0.0
    for replayed in records.values():
        duty, torque = replayed.columns["duty_pct"], replayed.columns["torque_nm"]
        falls = (np.diff(torque) < 0) & (duty[:-1] >= low)
        below = max(below, float(((duty > 0) & (duty < low)).mean()))
        above = max(above, float((duty > high).mean()))
        falling = max(falling, float(falls.mean()))
    falls_known = bool(setup.fit.recorded_falls)
    if max(below, above, 0.0 if falls_known else falling) <= UNSEEN:
        return []
    return [
        finding(
            "replay-leaves-identified", "nonlinear", below_pct=100 * below, above_pct=100 * above,
            falling_pct=None if falls_known else 100 * falling, low=low, high=high, unit=setup.fit.data.input_unit,
        )
    ]  # fmt: skip


def _over_drawn_plants(
    setup: Setup, wanted: Reference, records: dict[str, Record], head: Head, progress: Progress
) -> tuple[Head, list[Finding]]:
    """Every metric over plants drawn from the fit's uncertainty, beside the fitted plant's."""
    options = setup.options
    count = options.plants or 0
    if count * len(wanted.torque_nm) > MOST_STEPS:
        raise UsageError(
            f"«plants» {count}: over {len(wanted.torque_nm):,} samples each, more than {MOST_STEPS:,} in all; ask for "
            f"{MOST_STEPS // len(wanted.torque_nm):,} at most, or a shorter «duration»"
        )
    all_alike = not drawable(setup.fit)
    drawn = draw(setup.fit, count, options.seed)
    plants = [perturbed(plant, options.perturb) for plant in drawn.plants]
    parameters = {name: np.array([getattr(plant, name) for plant in plants]) for name in ("tau1", "tau2", "Ts")}
    for controller in setup.controllers:
        with progress(f"{controller.name} on drawn plants", count) as tick:
            spread = montecarlo(plants, controller, wanted, setup.rig, options.seed, options.threads, tick)
        tables = {
            "plants/band_time_s": spread.band_time_s,
            "plants/band_nm": spread.band_nm,
            **{f"plants/metrics/{metric}": values for metric, values in spread.values.items()},
            **{f"plants/parameters/{name}": values for name, values in parameters.items()},
        }
        on_fitted = records[controller.name]
        metrics = msgspec.structs.replace(on_fitted.metrics, plants=spread.summary(plants))
        records[controller.name] = Record(on_fitted.columns, metrics, tables)
    head = msgspec.structs.replace(
        head, plants=count, plants_from="fitted-plant" if all_alike else "covariance", band_quantiles=QUANTILES
    )
    return head, [finding("plants-all-alike", "nonlinear")] if all_alike else list(drawn.findings)
