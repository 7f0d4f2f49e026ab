"""Controllers on a reference: the guarantee watched, what no log showed, drawn plants, and the least error."""

from collections.abc import Mapping

import msgspec
import numpy as np

from eaid.errors import UsageError
from eaid.findings import Finding, finding
from eaid.limits import MOST_STEPS
from eaid.progress import Progress
from eaid.replay.best import best as best_of
from eaid.replay.guarantee_watch import watch
from eaid.replay.loop import replay
from eaid.replay.montecarlo import QUANTILES, montecarlo
from eaid.replay.plant import perturbed, plant_terms
from eaid.replay.references import Reference
from eaid.replay.rig import Rig
from eaid.replay.scenarios import measure, record
from eaid.replay.setup import Setup
from eaid.results.gains import Gains
from eaid.results.replay import Head, Record
from eaid.uncertainty.draw import draw, drawable

UNSEEN = 0.01
"""Share of the samples that may lie outside what was identified without a word."""
Outcome = tuple[dict[str, Record], Head, list[Finding]]


def tracked(setup: Setup, wanted: Reference, gains: Gains | None, progress: Progress) -> Outcome:
    """Each controller on the reference; the guarantee watched along the robust one; plants, and the best duty."""
    options, records = setup.options, {}
    findings = _doubts(setup, wanted, gains)
    for each in setup.controllers:
        trace = replay(setup.plant, each, wanted.torque_nm, setup.rig, wanted.dt_s, options.seed)
        measured, columns = measure(trace, wanted), {}
        if each.name == "rc":
            watched = watch(each.gains, setup.plant, trace)
            measured = watched.measured(measured, wanted.begin)
            columns = {"chi_nm_s": watched.chi_nm_s, "rho_nm_s": watched.rho_nm_s}
        records[each.name] = record(trace, measured, columns)
    findings += _unseen(setup, records)
    head = Head("", dt_s=wanted.dt_s, counted_from_s=wanted.counted_from_s)
    if options.plants is not None:
        head, more = _spread(setup, wanted, records, head, progress)
        findings += more
    if options.best:
        findings += _best(setup, wanted, records)
    return records, head, findings


def _doubts(setup: Setup, wanted: Reference, gains: Gains | None) -> list[Finding]:
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


def _unseen(setup: Setup, records: Mapping[str, Record]) -> list[Finding]:
    """Where replays go through what no log showed: duties outside the identified ones, falls between levels."""
    low, high = setup.known.plant.u_range
    below = above = falling = 0.0
    for each in records.values():
        duty, torque = each.columns["duty_pct"], each.columns["torque_nm"]
        falls = (np.diff(torque) < 0) & (duty[:-1] >= low)
        below = max(below, float(((duty > 0) & (duty < low)).mean()))
        above = max(above, float((duty > high).mean()))
        falling = max(falling, float(falls.mean()))
    seen = bool(setup.fit.recorded_falls)
    if max(below, above, 0.0 if seen else falling) <= UNSEEN:
        return []
    return [
        finding(
            "replay-leaves-identified", "nonlinear", below_pct=100 * below, above_pct=100 * above,
            falling_pct=None if seen else 100 * falling, low=low, high=high, unit=setup.fit.data.input_unit,
        )
    ]  # fmt: skip


def _spread(
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
    without = not drawable(setup.fit)
    drawn = draw(setup.fit, count, options.seed)
    plants = [perturbed(plant, options.perturb) for plant in drawn.plants]
    for each in setup.controllers:
        with progress(f"{each.name} on drawn plants", count) as tick:
            found = montecarlo(plants, each, wanted, setup.rig, options.seed, options.threads, tick)
        kept = records[each.name]
        tables = {
            "plants/band_time_s": found.band_time_s,
            "plants/band_nm": found.band_nm,
            **{f"plants/metrics/{metric}": values for metric, values in found.values.items()},
            **{
                f"plants/parameters/{part}": np.array([getattr(p, part) for p in plants])
                for part in ("tau1", "tau2", "Ts")
            },
        }
        metrics = msgspec.structs.replace(kept.metrics, plants=found.summary(plants))
        records[each.name] = Record(kept.columns, metrics, tables)
    head = msgspec.structs.replace(
        head, plants=count, plants_from="fitted-plant" if without else "covariance", band_quantiles=QUANTILES
    )
    return head, [finding("plants-all-alike", "nonlinear")] if without else list(drawn.findings)


def _best(setup: Setup, wanted: Reference, records: dict[str, Record]) -> list[Finding]:
    """The least error, kept as a group `best`; each controller is told how far it is from it."""
    bare = Rig(saturation=setup.rig.saturation)
    found = best_of(setup.plant, wanted, setup.known.limits)
    measured = msgspec.structs.replace(
        measure(found.trace, wanted), rms_error_nm=found.rms_error_nm, bound_rms_nm=found.bound_nm,
        steady_rms_nm=found.steady_rms_nm,
    )  # fmt: skip
    least = found.rms_error_nm
    for name, each in records.items():
        rms = each.metrics.rms_error_nm or 0.0
        metrics = msgspec.structs.replace(
            each.metrics, rms_over_best=rms / least if least > 1e-9 else None, rms_above_best_nm=rms - least
        )
        records[name] = Record(each.columns, metrics, each.tables, each.role)
    records["best"] = record(found.trace, measured, role="best")
    return [finding("best-without-rig", "best")] if setup.rig != bare else []
