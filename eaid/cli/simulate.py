"""`eaid simulate`: controllers replayed on the fitted plant."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from eaid.cli import console
from eaid.cli.options import Force, Json, Output, Quiet, Seed
from eaid.errors import UsageError

if TYPE_CHECKING:
    from eaid.replay.controllers import Knowledge
    from eaid.replay.files import Record
    from eaid.replay.plant import PlantParameters
    from eaid.replay.references import Reference
    from eaid.replay.rehab import Rehabilitation
    from eaid.replay.rig import Rig


def command(
    fit: Annotated[Path, typer.Argument(metavar="FIT", help="fit.json of eaid fit.")],
    gains: Annotated[
        Path | None, typer.Option("--gains", help="gains.json of eaid tune-rc; rc and pi need it.")
    ] = None,
    controllers: Annotated[
        str | None,
        typer.Option(
            "--controller", help="Comma-separated: rc, pi, open-loop, inverse. Default: rc,pi; sweep adds open-loop."
        ),
    ] = None,
    scenario: Annotated[
        str | None, typer.Option("--scenario", help="steps, multisine (default), sweep or rehab.")
    ] = None,
    reference: Annotated[
        Path | None, typer.Option("--reference", help="A reference of your own: CSV time_s,reference_nm.")
    ] = None,
    duration: Annotated[
        float | None, typer.Option("--duration", help="Length of steps, multisine or rehab [s].")
    ] = None,
    rate: Annotated[float, typer.Option("--rate-hz", help="Control rate [Hz].")] = 1000.0,
    noise_nm: Annotated[float, typer.Option("--noise-nm", help="Noise on the measured torque, sd [N·m].")] = 0.0,
    noise_time: Annotated[
        float, typer.Option("--noise-correlation-s", help="Correlation time of the noise [s]; 0: white.")
    ] = 0.0,
    ripple_pct: Annotated[
        float, typer.Option("--ripple-pct", help="Rotor ripple, amplitude in % of the torque.")
    ] = 0.0,
    ripple_hz: Annotated[float, typer.Option("--ripple-hz", help="Its frequency [Hz].")] = 1 / 6,
    sensor_hz: Annotated[
        float, typer.Option("--sensor-hz", help="Corner of the torque sensor's low-pass [Hz]; 0: none.")
    ] = 0.0,
    delay: Annotated[int, typer.Option("--delay-samples", help="Control delay [samples].")] = 0,
    pwm_hz: Annotated[float, typer.Option("--pwm-hz", help="Duty latched once a PWM period [Hz]; 0: off.")] = 0.0,
    duty_bits: Annotated[int, typer.Option("--duty-bits", help="Resolution of the duty [bit]; 0: unlimited.")] = 0,
    saturation: Annotated[bool, typer.Option("--saturation/--no-saturation", help="Limit the duty to 0…100 %.")] = True,
    perturb: Annotated[
        str | None, typer.Option("--perturb", help="Factors on the plant, unknown to controllers: Ts=0.9,tau1=1.2.")
    ] = None,
    with_best: Annotated[
        bool,
        typer.Option("--best", help="The least error this plant allows, the future known; how far each is from it."),
    ] = False,
    limb_damping: Annotated[
        float | None, typer.Option("--limb-damping", help="rehab: damping of the limb [N·m·s/rad].")
    ] = None,
    limb_inertia: Annotated[float | None, typer.Option("--limb-inertia", help="rehab: its inertia [kg·m²].")] = None,
    output: Output = None,
    as_json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
    seed: Seed = 0,
) -> None:
    """Replay controllers on the fitted plant, from rest, and measure how well they track."""
    console.be_quiet(quiet)
    from eaid.files import refuse_to_overwrite

    path = output or Path("replay.h5")
    refuse_to_overwrite(path, force)
    if scenario is not None and reference is not None:
        raise UsageError("--scenario and --reference exclude each other; give one of them")
    if not rate > 0:
        raise UsageError(f"--rate-hz is {rate:g}; it must be above 0")
    name = "reference" if reference else scenario or "multisine"

    from eaid import __version__, store
    from eaid.replay.controllers import controller
    from eaid.replay.files import write_replay
    from eaid.replay.loop import replay
    from eaid.replay.plant import perturbed, plant_parameters
    from eaid.replay.rig import Rig
    from eaid.replay.scenarios import measure, record

    rig = Rig(noise_nm, noise_time, ripple_pct, ripple_hz, sensor_hz, delay, pwm_hz, duty_bits, saturation)
    known = _knowledge(fit, gains)
    chosen = [controller(each, known) for each in _names(controllers, name, known)]
    factors = _factors(perturb)
    plant = plant_parameters(perturbed(known.plant, factors))

    records: dict[str, Record] = {}
    best_found: dict[str, Any] = {}
    if name == "rehab":
        if with_best:
            raise UsageError("--best: in rehab the reference depends on what the limb does; choose another scenario")
        from eaid.replay.rehab import rehabilitate
        from eaid.replay.rehab_statistics import record as record_session

        exercise = _exercise(duration, limb_damping, limb_inertia)
        for each in chosen:
            records[each.name] = record_session(rehabilitate(plant, each, exercise, rig, 1.0 / rate, seed))
        shown: dict[str, Any] = {"counted_from_s": exercise.uncounted_s, **exercise.__dict__}
    else:
        if limb_damping is not None or limb_inertia is not None:
            raise UsageError("--limb-damping and --limb-inertia belong to --scenario rehab")
        wanted = _reference(name, reference, 1.0 / rate, duration)
        for each in chosen:
            done = replay(plant, each, wanted.torque_nm, rig, wanted.dt_s, seed)
            records[each.name] = record(done, measure(done, wanted))
        shown = {"counted_from_s": wanted.counted_from_s}
    results = {each: dict(kept.metrics) for each, kept in records.items()}
    if with_best:
        best_found = _best(plant, wanted, rig, known, results, records)
    inputs = {"fit": store.input_record(fit)}
    if gains:
        inputs["gains"] = store.input_record(gains)
    if reference:
        inputs["reference"] = store.input_record(reference)
    head: dict[str, Any] = {
        "eaid": __version__,
        "scenario": name,
        "seed": seed,
        "dt_s": 1.0 / rate,
        **shown,
        "rig": rig.__dict__,
        "perturb": factors,
        "inputs": inputs,
    }
    write_replay(path, records, head, force)
    if as_json:
        beside = {"best": best_found} if best_found else {}
        console.print_json({"schema": "eaid/replay/1", **head, "controllers": results, **beside})
    else:
        _show(name, results)
        _show_best(best_found, results)
    console.say(f"wrote {path}")


def _best(
    plant: "PlantParameters",
    wanted: "Reference",
    rig: "Rig",
    known: "Knowledge",
    results: dict[str, dict[str, Any]],
    records: dict[str, "Record"],
) -> dict[str, Any]:
    """The least error, kept as a group `best` of the file; each controller is told how far it is from it."""
    if not rig.saturation:
        raise UsageError("--best: is the best within the duty limits; leave out --no-saturation")
    from dataclasses import replace

    from eaid.replay.best import best
    from eaid.replay.files import Record
    from eaid.replay.scenarios import measure, record

    limits = next(((g.duty_min, g.duty_max) for g in (known.rc, known.pi) if g is not None), (0.0, 100.0))
    if replace(rig, saturation=True) != type(rig)():
        console.warn("--best is the bare plant's: noise, ripple, sensor, delay, PWM and duty resolution are left out")
    console.say("searching for the best duty")
    found = best(plant, wanted, limits)
    kept = record(found.replay(limits), measure(found.replay(limits), wanted))
    summary = {**kept.metrics, **found.numbers()}
    records["best"] = Record(kept.columns, summary)
    least = found.rms_error_nm
    for numbers in results.values():
        numbers["rms_over_best"] = numbers["rms_error_nm"] / least if least > 1e-9 else None
        numbers["rms_above_best_nm"] = numbers["rms_error_nm"] - least
    return summary


def _knowledge(fit: Path, gains: Path | None) -> "Knowledge":
    """What the controllers are made from; what is missing in the files stays None."""
    from eaid.control.gains import pi_from_json, rc_from_json
    from eaid.errors import DataError
    from eaid.fitting.result import linear_from_json, nonlinear_from_json
    from eaid.replay.controllers import Knowledge
    from eaid.store import read_json

    fitted = read_json(fit, "fit")
    if not fitted.get("nonlinear"):
        raise DataError(f"{fit}: holds no nonlinear model, which the replay's plant is; fit clutch data with it")
    given = read_json(gains, "gains") if gains else {}
    linear = None
    for source in (fitted.get("linear"), given.get("model")):
        if linear is None and isinstance(source, dict) and "a0" in source:
            linear = linear_from_json({"linear": source})
    return Knowledge(
        nonlinear_from_json(fitted),
        linear,
        rc_from_json(given, str(gains)) if given.get("rc") else None,
        pi_from_json(given, str(gains)) if given.get("pi") else None,
    )


def _names(controllers: str | None, scenario: str, known: "Knowledge") -> list[str]:
    """The controllers to replay; by default those that the files allow."""
    if controllers is not None:
        names = [name.strip() for name in controllers.split(",") if name.strip()]
        if not names or len(set(names)) < len(names):
            raise UsageError(f"--controller is {controllers!r}; name each controller once, with commas between")
        return names
    names = [name for name, held in (("rc", known.rc), ("pi", known.pi)) if held is not None]
    if scenario == "sweep" and known.linear is not None:
        names.append("open-loop")
    if not names:
        console.warn("no --gains, so rc and pi are left out; the controllers that need none are replayed")
        names = ["open-loop", "inverse"] if known.linear is not None else ["inverse"]
    return names


def _reference(name: str, path: Path | None, dt_s: float, duration_s: float | None) -> "Reference":
    from eaid.replay.references import from_file
    from eaid.replay.scenarios import SCENARIOS

    if path is not None:
        if duration_s is not None:
            raise UsageError("--duration does not go with --reference; the file says how long it is")
        return from_file(path, dt_s)
    if name not in SCENARIOS:
        raise UsageError(f"no scenario {name!r}; there are {', '.join(SCENARIOS)}, rehab")
    return SCENARIOS[name].reference(dt_s, duration_s)


def _exercise(duration_s: float | None, damping: float | None, inertia: float | None) -> "Rehabilitation":
    """The rehabilitation's own defaults where the user says nothing; the three modes are of one length."""
    from eaid.replay.rehab import MODES, Rehabilitation

    mode_s = None if duration_s is None else duration_s / len(MODES)
    said = {"mode_s": mode_s, "damping_nms": damping, "inertia_kgm2": inertia}
    return Rehabilitation(**{key: value for key, value in said.items() if value is not None})


def _factors(text: str | None) -> dict[str, float]:
    """`Ts=0.9,tau1=1.2` as numbers."""
    factors: dict[str, float] = {}
    for part in (text or "").split(","):
        name, _, value = part.partition("=")
        if not part.strip():
            continue
        try:
            factors[name.strip()] = float(value)
        except ValueError:
            raise UsageError(f"--perturb has {part.strip()!r}; write factors as Ts=0.9,tau1=1.2") from None
    return factors


def _show(scenario: str, results: dict[str, Any]) -> None:
    """The metrics as tables on stdout."""
    columns = ["controller", "largest error", "RMS", "mean", "IAE", "mean |Δu|", "saturated"]
    rows = [
        [
            name,
            f"{m['max_abs_error_nm']:.4g} N·m",
            f"{m['rms_error_nm']:.4g} N·m",
            f"{m['mean_abs_error_nm']:.4g} N·m",
            f"{m['iae_nm_s']:.4g} N·m·s",
            f"{m['mean_abs_duty_step_pct']:.3g} %",
            f"{100 * m['saturated_fraction']:.1f} %",
        ]
        for name, m in results.items()
    ]
    console.table(f"Tracking, scenario {scenario}", columns, rows)
    for name, m in results.items():
        if "steps" in m:
            columns = ["from", "to", "rise 10–90 %", "overshoot", "settling 2 %", "settling 5 %"]
            rows = [
                [
                    f"{s['from_nm']:g} N·m",
                    f"{s['to_nm']:g} N·m",
                    _seconds(s["rise_time_s"]),
                    f"{s['overshoot_pct']:.1f} %",
                    _seconds(s["settling_s"]),
                    _seconds(s["settling_5pct_s"]),
                ]
                for s in m["steps"]
            ]
            console.table(f"Steps, {name}", columns, rows)
        if "frequencies" in m:
            rows = [
                [
                    f"{f['frequency_hz']:g} Hz",
                    f"{f['gain_db']:.2f} dB" if f["gain_db"] is not None else "no response",
                    f"{f['phase_deg']:.1f}°",
                    f"{f['mean_abs_error_nm']:.4f} N·m",
                ]
                for f in m["frequencies"]
            ]
            console.table(f"Sweep, {name}", ["frequency", "gain", "phase", "mean |error|"], rows)
        if "modes" in m:
            _show_modes(name, m)


def _show_best(best: dict[str, Any], results: dict[str, Any]) -> None:
    """The least error, how good it is, and how far each controller is from it."""
    if not best:
        return
    rows = [["best found", f"{best['rms_error_nm']:.4g} N·m", "", f"{best['max_abs_error_nm']:.4g} N·m"]]
    for name, m in results.items():
        times = m["rms_over_best"]
        far = f"{times:.3g} times" if times is not None else f"{m['rms_above_best_nm']:.4g} N·m above"
        rows.append([name, f"{m['rms_error_nm']:.4g} N·m", far, f"{m['max_abs_error_nm']:.4g} N·m"])
    console.table("How far from the best", ["controller", "RMS", "from the best", "largest error"], rows)
    print(f"best duty: {best['verdict']}; without switching from sample to sample {best['steady_rms_nm']:.4g} N·m")


def _show_modes(name: str, m: dict[str, Any]) -> None:
    """The rehabilitation by mode, and what may be concluded from it."""
    rows = []
    for mode, part in m["modes"].items():
        error = part["abs_position_error_deg"]
        middle = f"{error['q1']:.2f}…{error['q3']:.2f}°"
        rows.append([mode, f"{error['median']:.2f}°", middle, f"{part['mean_abs_torque_error_nm']:.4f} N·m"])
    console.table(f"Rehabilitation, {name}", ["mode", "median |error|", "middle half", "mean |torque error|"], rows)
    rows = [
        [
            " and ".join(test["modes"]),
            _p(test["samples"]["p"]),
            _p(test["cycles"]["p_welch"]),
            _p(test["cycles"]["p_rank"]),
            _p(test["cycles"]["least_p_rank"]),
        ]
        for test in m["tests"]
    ]
    columns = ["modes", "p, t on samples (paper)", "p, Welch on cycle means", "p, ranks of them", "least p of ranks"]
    console.table(f"Do the modes differ? {name}", columns, rows)


def _p(value: float | None) -> str:
    if value is None:
        return "too few cycles"
    return f"{value:.2g}" if value > 0 else "< 1e-300"


def _seconds(value: float | None) -> str:
    return "never" if value is None else f"{value:.3f} s"
