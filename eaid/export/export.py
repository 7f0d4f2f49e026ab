"""Gains and plant → a folder that a rig is run from: written whole or not at all."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from eaid.control.defaults import counted_from_rest
from eaid.control.gains import plant_of
from eaid.control.kinds import LAW_KINDS
from eaid.control.margins import margins, operating_points, points_of
from eaid.errors import EaidError, GainsError
from eaid.export.constants import CONSTANTS, constants_of, name_in_code
from eaid.export.job import Job, Origin, head_of, laws_of, log_seconds, rig_for, source_of, vectors
from eaid.export.targets import MADE_BY, TARGETS, VECTOR_COLUMNS
from eaid.files import folder_written_whole, refuse_folder, sha256_of
from eaid.findings import Finding, finding, ranked, say, stops
from eaid.options import ExportOptions
from eaid.results import codec
from eaid.results.common import Input
from eaid.results.fit import Fit
from eaid.results.gains import Condition, Gains, Guarantee, Timing
from eaid.results.verdict import PLANT_MODELS

NOTICED_IDLE = 0.01  # Idle output of which is told, as a part of the largest
# Files of an export, beside the sketch that is named as its folder
MADE_FILES = re.compile(r"eaid_\w+\.\w+|(vectors|check|parameters)\.\w+|Makefile|README\.md")


def offered(gains: Gains, fit: Fit) -> tuple[str, ...] | None:
    """The laws that one may take to a rig, neither refused nor short of margin: None for all that these files hold,
    empty for none of them."""
    try:
        source = source_of(gains, fit)
    except EaidError:
        return ()
    plain = ExportOptions()
    short = {one.subject for one in gains.findings if one.code == "margin-missed"}
    short |= {name for name in CONSTANTS if LAW_KINDS[name].design is not None and "rc" in short}  # of its slopes
    laws = tuple(
        law for law in source.laws
        if law not in short and not stops(_warnings(source, (law,), source.made_for.rate_hz, plain))
    )  # fmt: skip
    return () if CONSTANTS.keys().isdisjoint(laws) else None if laws == source.laws else laws


def _warnings(source: Origin, laws: tuple[str, ...], rate_hz: float, options: ExportOptions) -> Iterator[Finding]:
    low, high = source.limits
    if not low <= options.duty_on_fault <= high:
        yield finding(
            "export-fault-outside", "export", duty=options.duty_on_fault, unit=source.units[0], low=low, high=high
        )
    for law in ("plant", "inverse"):
        if options.law is None and (what := source.left_out(law)):
            yield finding("export-left-out", law, what=what)
    if source.fit is not None:
        yield from counted_from_rest(source.fit, source.limits)
    if source.fit is not None and source.fit.turned:
        idle = 0.0 if source.plant is None else source.plant.idle
        yield finding("export-sign-turned", "torque", idle=idle, unit=source.units[1])
    if not CONSTANTS.keys().isdisjoint(laws) and source.gains is not None:
        yield from _gains_of_laws(source, source.gains, laws, rate_hz)
    if {"inverse", "plant"} & set(laws):
        subject = "plant" if "plant" in laws else "inverse"
        if source.fit is not None and (why := source.fit.verdict.of(*PLANT_MODELS).sentence):
            yield finding("export-not-usable", subject, why=why)
        if (plant := source.plant) is not None:
            if "inverse" in laws and plant.dead_time_s > 0:
                yield finding("export-no-dead-time", "inverse", dead_time_s=plant.dead_time_s)
            if plant.release is None and plant.kind == "parallel" and not (source.fit and source.fit.logs):
                yield finding("export-no-release", subject)
            if plant.excess:
                yield finding("export-no-hysteresis", subject, excess_pct=100 * plant.excess)
            if abs(plant.idle) > NOTICED_IDLE * source.top:
                yield finding("export-from-rest", subject, idle=plant.idle, unit=source.units[1])


def _gains_of_laws(source: Origin, gains: Gains, laws: tuple[str, ...], rate_hz: float) -> Iterator[Finding]:
    made_hz = source.made_for.rate_hz
    other_rate = abs(rate_hz - made_hz) > 1e-6 * made_hz
    yield from _unstable(source, gains, laws, rate_hz, other_rate)
    if why := gains.not_usable or (source.fit.verdict.of("linear").sentence if source.fit is not None else ""):
        yield finding("export-not-usable", "gains", why=why)
    yield from stops(gains.findings)
    yield from (one for one in gains.findings if one.code == "for-this-mounting")  # which the code does not know
    if "rc" in laws and (rc := gains.rc) is not None:
        rho, phi = Condition("rho", rc.guaranteed), Condition("phi", rc.phi_holds)  # all that some files say of it
        told = gains.guarantee
        if told is None:
            told = Guarantee(rc.guaranteed and rc.phi_holds is not False, (rho, phi))
        answer = "unknown" if told.holds is None else "holds" if told.holds else "missing"
        yield finding(f"export-guarantee-{answer}", "rc", missing=told.missing or ("unknown",))
    if other_rate:
        yield finding("export-other-rate", "gains", rate_hz=rate_hz, made_hz=made_hz)
    worst = gains.margins.worst if gains.margins else {}
    numbers = {
        f"{law}_{key}": getattr(margin, key)
        for law in laws
        if (margin := worst.get(law)) is not None
        for key in ("gain_db", "phase_deg")
    }
    if numbers:
        yield finding("export-margins", "gains", **numbers)


def _unstable(
    source: Origin, gains: Gains, laws: tuple[str, ...], rate_hz: float, other_rate: bool
) -> Iterator[Finding]:
    """Each loop around held duties of the plant, else on the linear model, at the rate that is baked in."""
    kept = gains.margins.points if gains.margins and not other_rate else ()
    if source.fit is not None:
        points = points_of(source.fit, source.plant, gains.model, (), source.limits)
    else:
        levels = [point.duty_pct for point in kept]
        points = operating_points(source.plant, gains.model, (), levels, source.limits)
    made = source.made_for
    timing = Timing(rate_hz, made.pwm_hz, made.delay_samples / made.rate_hz * rate_hz)
    for law, controller in sorted(source.loops.items()):
        if law not in laws:
            continue
        bad = {point.duty_pct for point in points if not margins(controller, point, timing).stable}
        bad |= {point.duty_pct for point in kept if (one := point.loops.get(law)) is not None and one.stable is False}
        if bad:
            yield finding("export-unstable", law.upper(), sorted(bad), rate_hz=rate_hz, unit=source.units[0])


def is_export(path: Path, ends: bytes) -> bool:
    """Whether a file, by its name, its first and last bytes, is one of an export."""
    named = MADE_FILES.fullmatch(path.name) or path.name == f"{path.resolve().parent.name}.ino"
    return bool(named) and (MADE_BY in ends or ends.startswith(VECTOR_COLUMNS.encode()))


@dataclass(frozen=True)
class ExportFolder:
    """What was written."""

    path: Path
    target: str
    laws: tuple[str, ...]
    files: tuple[str, ...]
    dt_s: float
    findings: tuple[Finding, ...]  # What stands at the head of each file, the gravest first


def export(
    gains: Gains | None, fit: Fit | None, options: ExportOptions, folder: Path, force: bool = False,
    command: str = "", inputs: Sequence[Input] = (),
) -> ExportFolder:  # fmt: skip
    """`eaid.export` with what made it, `command` and `inputs`, at the head of its files. GainsError where a loop is
    unstable at the sample rate or a finding of severity stop stands; `anyway` overrides, marked."""
    refuse_folder(folder, force, is_export, "eaid export", (Path(each.path) for each in inputs), names=())
    source = source_of(gains, fit)
    laws = laws_of(source, options)
    rig = rig_for(source, options)
    constants = constants_of(source.loops, source.plant, source.limits, laws, rig)
    findings = ranked(_warnings(source, laws, 1.0 / rig.dt_s, options))
    if grave := stops(findings):
        if not options.anyway:
            raise GainsError(*(f"{say(one)}; «anyway» exports it all the same, marked" for one in grave))
        findings = (finding("export-anyway", "export"), *findings)
    limits = source.limits if set(laws) - {"plant"} else (0.0, source.plant.u_range[1] if source.plant else 0.0)
    job = Job(
        rig, tuple(map(name_in_code, laws)), constants, tuple(vectors(constants, source.top, rig)),
        head_of(source, laws, rig, findings, command, inputs), options.target, folder.resolve().name,
        source.top, limits, log_seconds(source.plant),
    )  # fmt: skip
    files = dict(TARGETS[options.target](job))
    with folder_written_whole(folder, is_export) as part:
        for name, content in files.items():
            data = content if isinstance(content, bytes) else content.encode("utf-8")
            (part / name).write_bytes(data)
        refuse_folder(folder, force, is_export, "eaid export", names=files)
    return ExportFolder(folder, options.target, laws, tuple(files), rig.dt_s, findings)


def fit_beside(gains: Gains, path: Path) -> Path | None:
    """The fit that gains were made from, where its file is still there, unchanged, and holds a plant."""
    named = gains.inputs.get("fit")
    if not isinstance(named, Input) or not named.sha256:
        return None
    for candidate in (path.parent / named.path, path.parent / Path(named.path).name, Path(named.path)):
        if candidate.is_file() and sha256_of(candidate) == named.sha256:
            return candidate if plant_of(codec.read_as(candidate, Fit)[0]) is not None else None
    return None
