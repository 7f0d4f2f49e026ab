"""`eaid synth`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from eaid.cli import console
from eaid.cli.options import Force, Json, Output, Quiet, Seed
from eaid.errors import UsageError

if TYPE_CHECKING:
    from eaid.logs.run import Kind, Run
    from eaid.synth.disturbance import Disturbance
    from eaid.synth.plants import Plant


def command(
    kind: Annotated[
        str | None,
        typer.Option("--kind", help="clutch (default), friction-force or friction-speed; of a fit.json, its own."),
    ] = None,
    plant: Annotated[str, typer.Option("--plant", help="reference, or a fit.json.")] = "reference",
    levels: Annotated[
        str | None, typer.Option("--levels", help="Inputs [%, N or RPM]: 30,40,90 or from:to:step.")
    ] = None,
    repeats: Annotated[int | None, typer.Option("--repeats", help="Runs of each level.")] = None,
    idle: Annotated[float | None, typer.Option("--idle", help="Input 0 before the step [s].")] = None,
    hold: Annotated[float | None, typer.Option("--hold", help="Input at its level [s].")] = None,
    release: Annotated[float | None, typer.Option("--release", help="Input 0 after the step [s].")] = None,
    rate: Annotated[float | None, typer.Option("--rate", help="Samples a second [Hz].")] = None,
    duty_file: Annotated[
        Path | None,
        typer.Option("--duty-file", help="CSV time_s,duty_pct (force_n, speed_rpm): this input in place of steps."),
    ] = None,
    plan: Annotated[
        Path | None, typer.Option("--plan", help="The run table of eaid plan: its levels, repeats, times and order.")
    ] = None,
    excitation: Annotated[
        str | None,
        typer.Option("--excitation", help="staircase, random, prbs, multisine, chirp or closed-loop."),
    ] = None,
    shape: Annotated[
        str | None,
        typer.Option(
            "--shape",
            help="Of the excitation: duration_s=240,hold_s=0.5:20,duty=10:100,levels=10,rest_s=5,idle_s=2,"
            "frequency_hz=0.05:5,reference_nm=0.6:3.6,gains=21:360.",
        ),
    ] = None,
    gains: Annotated[
        Path | None, typer.Option("--gains", help="Closed loop: a gains.json, whose controller drives it.")
    ] = None,
    controller: Annotated[str, typer.Option("--controller", help="Of the gains.json: pi or rc.")] = "pi",
    clean: Annotated[
        bool, typer.Option("--clean", help="The plant alone: no noise, scatter, offset or digits.")
    ] = False,
    white_nm: Annotated[float | None, typer.Option("--noise-nm", "--white-nm", help="White noise, sd [N·m].")] = None,
    coloured: Annotated[float | None, typer.Option("--coloured", help="Coloured noise, sd, share of torque.")] = None,
    coloured_s: Annotated[float | None, typer.Option("--coloured-s", help="Its time constant [s].")] = None,
    ripple: Annotated[float | None, typer.Option("--ripple", help="Rotor ripple, amplitude, share of torque.")] = None,
    gain_scatter: Annotated[
        float | None, typer.Option("--gain-scatter", help="Run-to-run sd of the torque's gain, share.")
    ] = None,
    tau1_scatter: Annotated[float | None, typer.Option("--tau1-scatter", help="Run-to-run sd of log tau1.")] = None,
    tau2_scatter: Annotated[float | None, typer.Option("--tau2-scatter", help="Run-to-run sd of log tau2.")] = None,
    offset_nm: Annotated[float | None, typer.Option("--offset-nm", help="Offset of the torque sensor [N·m].")] = None,
    jitter_s: Annotated[float | None, typer.Option("--jitter-s", help="Sample instants, sd [s].")] = None,
    resolution_nm: Annotated[
        float | None, typer.Option("--resolution-nm", help="Step of the sensor's digits [N·m].")
    ] = None,
    output: Output = None,
    seed: Seed = 0,
    as_json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Make a synthetic dataset of a plant: a data.h5, or a folder of CSV when -o has no .h5 ending."""
    console.be_quiet(quiet)
    from dataclasses import replace

    from eaid.synth.disturbance import NONE, Disturbance
    from eaid.synth.logs import KINDS

    output = output or Path("synthetic.h5")
    _refuse(output, force)
    if kind is not None and kind not in KINDS:
        raise UsageError(f"--kind {kind}: is not one of {', '.join(KINDS)}")
    given = {
        "white_nm": white_nm,
        "coloured": coloured,
        "coloured_s": coloured_s,
        "ripple": ripple,
        "gain_scatter": gain_scatter,
        "tau1_scatter": tau1_scatter,
        "tau2_scatter": tau2_scatter,
        "offset_nm": offset_nm,
        "jitter_s": jitter_s,
        "resolution_nm": resolution_nm,
    }
    sizes: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    disturbance = replace(NONE if clean else Disturbance(), **sizes)
    recorded, inputs = _plant(kind, plant)
    inputs += [path for path in (duty_file, plan) if path is not None]
    said = {
        "levels": None if levels is None else _levels(levels),
        "repeats": repeats,
        "idle_s": idle,
        "hold_s": hold,
        "release_s": release,
        "rate_hz": rate,
    }
    if excitation is not None:
        if duty_file is not None or plan is not None or _is_dataset(output):
            raise UsageError("--excitation: writes a folder of CSV (-o FOLDER), and excludes --duty-file and --plan")
        from eaid.cli.synth_excitation import excited

        runs = excited(recorded, excitation, shape, gains, controller, repeats, rate, disturbance, seed)
    else:
        runs = _runs(recorded, disturbance, said, duty_file, plan, seed)
    _write(output, runs, force)
    summary = _summary(output, runs, recorded, disturbance, inputs, seed)
    console.say(f"{output}: {len(runs)} synthetic runs of {recorded.made_of}, seed {seed}")
    if as_json:
        console.print_json(summary)


def _is_dataset(output: Path) -> bool:
    return output.suffix.lower() in (".h5", ".hdf5")


def _refuse(output: Path, force: bool) -> None:
    from eaid.files import refuse_to_overwrite
    from eaid.synth.folder import refuse_folder

    (refuse_to_overwrite if _is_dataset(output) else refuse_folder)(output, force)


def _plant(kind: str | None, plant: str) -> tuple["Plant", list[Path]]:
    from eaid.store import input_record, read_json
    from eaid.synth.plants import REFERENCE, of_fit

    if plant == "reference":
        return REFERENCE[kind or "clutch"](), []
    path = Path(plant)
    fit = read_json(path, "fit", console.warn)
    kind = kind or (fit.get("data") or {}).get("kind") or "clutch"
    return of_fit(fit, cast("Kind", kind), f"{path} (sha256 {input_record(path)['sha256'][:12]})"), [path]


def _runs(
    plant: "Plant",
    disturbance: "Disturbance",
    said: dict[str, Any],
    duty_file: Path | None,
    plan: Path | None,
    seed: int,
) -> list["Run"]:
    """Logs by the protocol of the kind and what the user says of it, or by one of the two files."""
    from dataclasses import replace

    from eaid.synth.input import read_input, read_plan
    from eaid.synth.logs import PROTOCOLS, synthesise, synthesise_input, synthesise_plan

    chosen = {name: value for name, value in said.items() if value is not None}
    protocol = replace(PROTOCOLS[plant.kind], **{"levels": plant.levels, **chosen})
    if duty_file is None and plan is None:
        return synthesise(plant, protocol, disturbance, seed)
    if duty_file is not None and plan is not None:
        raise UsageError("--duty-file and --plan exclude each other; give one of them")
    name, free = ("--plan", {"rate_hz"}) if plan else ("--duty-file", {"rate_hz", "repeats"})
    if set(chosen) - free:
        raise UsageError(f"{name}: says levels and times itself; leave out --levels, --idle, --hold and --release")
    if plan is not None:
        return synthesise_plan(plant, read_plan(plan), protocol.rate_hz, disturbance, seed)
    assert duty_file is not None
    changes, duration_s = read_input(duty_file, plant.kind)
    timing = replace(protocol, idle_s=0.0, hold_s=duration_s, release_s=0.0)
    return synthesise_input(plant, changes, timing, disturbance, seed)


def _levels(text: str) -> tuple[float, ...]:
    """`30,40,90`, or `from:to:step` with both ends."""
    try:
        if ":" not in text:
            return tuple(float(part) for part in text.split(","))
        start, end, step = (float(part) for part in text.split(":"))
        count = round((end - start) / step)
    except (ValueError, ZeroDivisionError, OverflowError):
        raise UsageError(f"--levels {text}: give levels as 30,40,90 or as from:to:step") from None
    if not 0 <= count <= 10_000 or abs(start + count * step - end) > 1e-9 * abs(step):
        raise UsageError(f"--levels {text}: the step does not lead from {start:g} to {end:g}")
    return tuple(start + k * step for k in range(count + 1))


def _write(output: Path, runs: list["Run"], force: bool) -> None:
    if _is_dataset(output):
        from eaid.synth.datasets import write

        write(output, runs, force)
    else:
        from eaid.synth.folder import write_folder

        write_folder(output, runs, force)


def _summary(
    output: Path, runs: list["Run"], plant: "Plant", disturbance: "Disturbance", inputs: list[Path], seed: int
) -> dict[str, Any]:
    from dataclasses import asdict

    from eaid.store import input_record, stamped

    rows = [{"name": run.name, "level": run.level, "repeat": run.repeat, "samples": run.time_s.size} for run in runs]
    return stamped(
        "eaid/synth/1",
        {
            "output": str(output),
            "synthetic": runs[0].synthetic,
            "kind": plant.kind,
            "plant": plant.made_of,
            "inputs": [input_record(path) for path in inputs],
            "seed": seed,
            "disturbance": asdict(disturbance),
            "runs": rows,
        },
    )
