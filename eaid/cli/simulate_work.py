"""What `eaid simulate` does with a scenario or a log: replays, the guarantee, the spread over plants, the best."""

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eaid.cli import console

if TYPE_CHECKING:
    from eaid.logs.options import ReadOptions
    from eaid.replay.controllers import Controller, Knowledge
    from eaid.replay.files import Record
    from eaid.replay.plant import PlantParameters
    from eaid.replay.references import Reference
    from eaid.replay.rehab import Rehabilitation
    from eaid.replay.rig import Rig


@dataclass
class Outcome:
    """What is written and shown, as it comes together."""

    records: "dict[str, Record]" = field(default_factory=dict)
    results: dict[str, dict[str, Any]] = field(default_factory=dict)
    """Controller → its metrics."""
    head: dict[str, Any] = field(default_factory=dict)
    """Further root attributes."""
    best: dict[str, Any] = field(default_factory=dict)
    log: dict[str, Any] = field(default_factory=dict)
    """Run → how far the model is from it."""


def scenario(
    plant: "PlantParameters", chosen: "list[Controller]", wanted: "Reference", rig: "Rig", seed: int
) -> Outcome:
    """Each controller on the reference; the guarantee watched along the robust one."""
    from eaid.replay.loop import replay
    from eaid.replay.scenarios import measure, record

    done = Outcome(head={"counted_from_s": wanted.counted_from_s})
    costs = []
    for each in chosen:
        start = time.perf_counter()
        replayed = replay(plant, each, wanted.torque_nm, rig, wanted.dt_s, seed)
        costs.append(f"{each.name} {(time.perf_counter() - start) / len(wanted.torque_nm) * 1e6:.2g} µs")
        measured, columns = measure(replayed, wanted), {}
        if each.name == "rc":
            from eaid.replay.guarantee import watch

            watched = watch(each.gains, plant, replayed)
            measured |= watched.numbers(round(wanted.counted_from_s / wanted.dt_s))
            columns = {"chi_nm_s": watched.chi_nm_s, "rho_nm_s": watched.rho_nm_s}
        done.results[each.name] = measured
        done.records[each.name] = record(replayed, measured, columns)
    console.say(f"cost of a step in plain Python, plant and rig included: {', '.join(costs)}")
    return done


def rehab(
    plant: "PlantParameters", chosen: "list[Controller]", exercise: "Rehabilitation", rig: "Rig", dt_s: float, seed: int
) -> Outcome:
    """The rehabilitation of §VII with each controller."""
    from eaid.replay.rehab import rehabilitate
    from eaid.replay.rehab_statistics import record

    done = Outcome(head={"counted_from_s": exercise.uncounted_s, **exercise.__dict__})
    for each in chosen:
        done.records[each.name] = record(rehabilitate(plant, each, exercise, rig, dt_s, seed))
        done.results[each.name] = dict(done.records[each.name].metrics)
    return done


@dataclass(frozen=True)
class Draw:
    """Which plants the Monte-Carlo takes."""

    fitted: dict[str, Any]
    count: int
    seed: int
    factors: dict[str, float]
    threads: int | None


def spread(done: Outcome, chosen: "list[Controller]", wanted: "Reference", rig: "Rig", draw: Draw) -> None:
    """Every metric over plants drawn from the fit's uncertainty, beside the fitted plant's."""
    import numpy as np

    from eaid.replay.files import Record
    from eaid.replay.montecarlo import QUANTILES, montecarlo
    from eaid.replay.plant import perturbed
    from eaid.uncertainty.draw import covariance_word, draw_plants

    word = covariance_word(draw.fitted)
    if word is not None:
        console.warn(word)
    plants = [perturbed(plant, draw.factors) for plant in draw_plants(draw.fitted, draw.count, draw.seed)]
    done.head |= {
        "plants": draw.count,
        "plants_from": word or "nonlinear.covariance",
        "band_quantiles": list(QUANTILES),
    }
    for each in chosen:
        with console.progress(f"{each.name} on drawn plants", draw.count) as tick:
            found = montecarlo(plants, each, wanted, rig, draw.seed, draw.threads, tick)
        done.results[each.name]["plants"] = {"count": draw.count, "metrics": found.summary(plants)}
        kept = done.records[each.name]
        tables = {
            "plants/band_time_s": found.band_time_s,
            "plants/band_nm": found.band_nm,
            **{f"plants/metrics/{metric}": values for metric, values in found.values.items()},
            **{
                f"plants/parameters/{part}": np.array([getattr(p, part) for p in plants])
                for part in ("tau1", "tau2", "Ts")
            },
        }
        done.records[each.name] = Record(kept.columns, done.results[each.name], tables)


def log(
    plant: "PlantParameters",
    chosen: "list[Controller]",
    paths: list[Path],
    options: "ReadOptions",
    rig: "Rig",
    seed: int,
    keep_baseline: bool,
) -> Outcome:
    """Recorded runs: their duty through the plant, and over closed-loop runs the controllers replayed."""
    from eaid.logs.folders import files_of
    from eaid.logs.read import read_runs
    from eaid.replay import recorded
    from eaid.replay.files import Record
    from eaid.replay.scenarios import measure, record

    done = Outcome()
    runs = [recorded.recorded(run, plant, keep_baseline) for run in read_runs(files_of(paths, console.warn), options)]
    closed = [run for run in runs if run.reference_nm is not None]
    for run in runs:
        numbers = recorded.difference(run)
        done.log[run.name] = numbers
        # The model's torque is compared with the recorded one, which stands where a replay has its reference.
        columns = {
            "time_s": run.time_s,
            "reference_nm": run.recorded_nm,
            "torque_nm": run.model_nm,
            "duty_pct": run.duty_pct,
        }
        done.records[run.name] = Record(columns, {**numbers, "reference_is": "recorded torque"})
    for run in closed:
        before = f"{run.name} " if len(closed) > 1 else ""
        assert run.reference_nm is not None
        measured = recorded.closed_loop_metrics(run)
        columns = {
            "time_s": run.time_s,
            "reference_nm": run.reference_nm,
            "torque_nm": run.recorded_nm,
            "duty_pct": run.duty_pct,
        }
        done.results[f"{before}recorded"] = dict(measured)
        done.records[f"{before}recorded"] = Record(columns, measured)
        wanted = recorded.reference_of(run)
        for each in chosen:
            replayed = recorded.laid_over(run, plant, each, rig, seed)
            done.results[f"{before}{each.name}"] = {
                **measure(replayed, wanted),
                **recorded.against(run, replayed),
            }
            done.records[f"{before}{each.name}"] = record(replayed, done.results[f"{before}{each.name}"])
    return done


def best(
    plant: "PlantParameters",
    wanted: "Reference",
    rig: "Rig",
    known: "Knowledge",
    results: dict[str, dict[str, Any]],
    records: dict[str, "Record"],
) -> dict[str, Any]:
    """The least error, kept as a group `best` of the file; each controller is told how far it is from it."""
    from dataclasses import replace

    from eaid.replay.best import best as best_of
    from eaid.replay.files import Record
    from eaid.replay.scenarios import measure, record

    limits = next(((g.duty_min, g.duty_max) for g in (known.rc, known.pi) if g is not None), (0.0, 100.0))
    if replace(rig, saturation=True) != type(rig)():
        console.warn("--best is the bare plant's: noise, ripple, sensor, delay, PWM and duty resolution are left out")
    console.say("searching for the best duty")
    found = best_of(plant, wanted, limits)
    kept = record(found.replay(limits), measure(found.replay(limits), wanted))
    summary = {**kept.metrics, **found.numbers()}
    records["best"] = Record(kept.columns, summary)
    least = found.rms_error_nm
    for numbers in results.values():
        numbers["rms_over_best"] = numbers["rms_error_nm"] / least if least > 1e-9 else None
        numbers["rms_above_best_nm"] = numbers["rms_error_nm"] - least
    return summary
