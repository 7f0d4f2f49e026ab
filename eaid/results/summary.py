"""A fit in a few lines: how well it follows, T_s, τ1 and τ2 where it matters, which estimate, warnings."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

from eaid.findings import Finding, enumerated, merged, ranked, say
from eaid.findings.finding import MOST_TOLD, WORD
from eaid.findings.row import NUMBER_NAMES, SYMBOLS
from eaid.findings.sentences.fitting import kind_in_words
from eaid.plant.steps import peak_of
from eaid.results.common import Interval, ci95_of
from eaid.results.plant import LAGS, FittedPlant
from eaid.results.verdict import MODEL_PARTS, in_short
from eaid.shown import counted, number, span

if TYPE_CHECKING:
    from eaid.results.fit import Fit
    from eaid.results.models import CurveLevel, FrictionLevel, StepShape
    from eaid.results.responses import LevelResponse

T = TypeVar("T")

ENDLESS_S = 1e4  # A time constant above this [s] that no interval bounds is no number worth showing
# What of a fit's warnings means for all that is made of it
MEANT = {
    "output-decays-under-hold": " (T_s is an average)", "rise-of-the-rig": " (τ1 and τ2 are the stand's loading)",
    "moves-with-step": " (its τ may be the loading's)", "flat-topped": " (its τ may be the loading's)",
    "several-sessions": " (levels of several days)",
    "curve-misses-levels": " (it explains nothing there)",
    "signs-turned": " (the output counts with its sign turned)", "input-late": "", "runs-left-out": "",
}  # fmt: skip
# Estimates that stand as the nonlinear model
USED = {"levels-first": "levels first, then the curves", "joint": "all levels at once, as in the paper, as you asked"}


def fit_summary(fit: "Fit") -> list[str]:
    """Whether it must not be used, what was fitted, the answer, and the three gravest findings."""
    return [
        *verdict_line(fit),
        f"{fit.data.kind}: {span(fit.data.levels, fit.data.input_unit)}; {runs(fit, 'run')}",
        *answer(fit),
        usable_line(fit),
        *(f"{WORD[one.severity]}: {say(one)}" for one in ranked(merged(fit.findings))[:MOST_TOLD]),
    ]


def verdict_line(fit: "Fit") -> list[str]:
    """`NOT USABLE: …` with the gravest reason, where the fit must not be used."""
    reasons = fit.verdict.reasons
    return [f"NOT USABLE: {say(reasons[0])}"] if reasons else []


def runs(fit: "Fit", noun: str) -> str:
    """`30 runs, synthetic`."""
    count = sum(fit.data.repeats) or len(fit.data.sources)
    return counted(count, noun) + (", synthetic" if fit.data.synthetic else "")


def answer(fit: "Fit") -> list[str]:
    """The lines that answer first: fit %, values with 95 % intervals where they matter, which estimate they are."""
    model = fit.nonlinear
    told = fit.another_plant is not None and fit.another_plant.tried[0].gain != "curve"  # by its own line
    lines = [f"fit    {_fit_pct(fit)}", *replayed(fit), *unseen(fit), *plant_lines(fit), *([] if told else _shown(fit))]
    if model is not None and steps_of_other_shapes(fit):
        lines.append("shown  single steps with their dead times; the models have none")
    elif model is not None and fit.another_plant is None:
        used = USED[model.estimator] if fit.recorded is None else "the recorded log as a whole, every input at once"
        parted = any(one.code in ("joint-fit-parts", "joint-fit-asked-for-parts") for one in fit.findings)
        apart = " (not the joint fit, which gains that scatter lead astray)" if parted else ""
        known = any(one.code == "share-by-evidence" for one in fit.findings)
        share = f", C {_with_ends(model.C, None if model.ci95 is None else model.ci95.C, 3)}" if known else ""
        lines.append(f"used   {used}{apart}{_late(fit)}{share}")
    return [*lines, *_hold_line(fit)]


def replayed(fit: "Fit") -> list[str]:
    """What `simulate` gives for the logs of steps that were fitted: each by itself, not the mean of repeats."""
    known = sorted(one.fit_pct for one in fit.data.replayed if one.fit_pct is not None)
    if not known:
        return []
    spread = f"{known[0]:.1f} … {known[-1]:.1f} %, median " if len(known) > 1 else ""
    logs = counted(len(known), "log")
    return [f"logs   {spread}{known[len(known) // 2]:.1f} % of {logs} played again through the plant"]


def unseen(fit: "Fit") -> list[str]:
    """How the model holds on what fits without it have not seen, beside what it explains of the same when it has."""
    if fit.recorded is not None and (logs := fit.recorded.hold_out) is not None and logs.held_pct is not None:
        several = logs.of == "logs"
        whose, they = ("logs left out in turn", "they are") if several else (f"the {logs.of} left out", "it is")
        known = f"{number(logs.fit_pct, 3)} % where {they} fitted"
        return [f"unseen {logs.held_pct:.1f} % explained of {whose} ({known})"]
    said, left = held_out_line(fit), None if fit.nonlinear is None else fit.nonlinear.left_out
    if left is None or left.held_pct is None or left.worst is None:
        return said
    at = f"{left.worst:.4g} {fit.data.input_unit}".rstrip()
    off = f"T_s off by {number(left.Ts_off_pct, 3)} % (median), at worst {number(left.worst_off_pct, 3)} % at {at}"
    known = f"{number(left.fit_pct, 3)} % where they are fitted"
    in_turn = f"unseen {left.held_pct:.1f} % explained of levels left out in turn ({known}), {off}"
    return [*said, in_turn]


def held_out_line(fit: "Fit") -> list[str]:
    """How far the first model is off the levels that the user held out."""
    known = [part.hold_out for part in (fit.nonlinear, fit.friction, fit.linear) if part is not None and part.hold_out]
    if not known or known[0].rmse is None:
        return []
    held, unit = known[0], fit.data.output_unit
    at = enumerated([one.level for one in held.levels], fit.data.input_unit)
    errors = f"RMSE {number(held.rmse, 3)} {unit}".rstrip()
    return [f"unseen {at}, held out: {errors} ({number(held.fitted_rmse, 3)} on the levels fitted)"]


def plant_lines(fit: "Fit") -> list[str]:
    """The plant where it is of another kind than the clutch's: its numbers with intervals; of one that overshoots the
    peak of a step over its end, when, and what it loses again."""
    part = fit.another_plant
    if part is None:
        return []
    numbers = [f"{name} {value}" for name, value in plant_values(part)]
    said = [f"plant  {kind_in_words(part.tried[0].kind)}: {', '.join(numbers)}"]
    if part.kind == "overshoot":
        at, peak = peak_of(replace(part.plant.at(part.u_range[1]), Ts=1.0))
        lost = 100 * (1 - 1 / peak)
        said.append(f"peaks  a step reaches {peak:.4g} of its end after {at:.3g} s, and loses {lost:.3g} % of that")
    return said


ONE_GAIN = 0.01  # Part by which the gains at both ends of the range may differ that are told as one


def plant_values(part: FittedPlant) -> list[tuple[str, str]]:
    """Gain, time constants, frequency and damping, dead time of a plant, each with its unit and interval."""
    found = []
    both = part.output_unit, part.input_unit
    per = f" {'/'.join(both)}" if all(both) else ""
    units = {"gain": per, "gain_below": per, "omega": " rad/s", "zeta": "", "C": ""}
    for key, (value, ends) in part.numbers.items():
        name = "τ" if key == "tau1" and part.kind == "lag" else NUMBER_NAMES.get(key, key)
        said, unit = _with_ends(value, ends, 4), units.get(key, " s")
        if part.paced and key in LAGS:
            said, unit = " … ".join(f"{part.at(u)[key][0]:.4g}" for u in part.u_range), f"{unit} over the input"
        gains = [float(part.plant.steady(u)) / u for u in part.u_range if u] if key == "gain" else []
        if len(gains) > 1 and abs(gains[0] - gains[1]) > ONE_GAIN * abs(gains[1]):
            said, unit = " … ".join(f"{one:.4g}" for one in gains), f"{unit} over the input"
        found.append((name, f"{said}{unit}"))
    return found


def _late(fit: "Fit") -> str:
    """Behind which dead time the curves begin; empty: none."""
    if fit.plant_ is None or fit.plant_.dead_time_s <= 0:
        return ""
    value, ends = fit.plant_.numbers["dead_time_s"]
    return f", behind a dead time of {_with_ends(value, ends, 3)} s"


def _hold_line(fit: "Fit") -> list[str]:
    """How the highest level comes, slips and goes, as recorded; that T_s is an average where it slips."""
    if not fit.responses:
        return []
    top, unit = max(fit.responses, key=lambda one: one.level), f" {fit.data.output_unit}".rstrip()
    said = [f"{_with_interval(top, 'held')}{unit}" if top.held is not None else ""]
    for name, verb in (("engaged_s", "engaged in"), ("released_s", "released in")):
        if getattr(top, name) is not None:
            said.append(f"{verb} {_with_interval(top, name)} s")
    if top.peak is not None:
        shown = fit.another_plant is not None
        after = "" if top.peak_s is None else f" after {top.peak_s:.3g} s"
        said.append(f"peaks at {top.peak:.3g}{unit}{after}{', so T_s is an average' * (not shown)}")
    level = f"{top.level:.4g} {fit.data.input_unit}".rstrip()
    return [f"held   at {level}: {', '.join(filter(None, said))}"]


def _by_codes(findings: Sequence[Finding]) -> str:
    """Findings by their codes, and what they mean for all else."""
    return ", ".join(in_short(one) + MEANT.get(one.code, "") for one in findings)


def usable_line(fit: "Fit") -> str:
    """Whether it may be used, and its three gravest warnings: the last line of its answer."""
    grave = [one for one in ranked(merged(fit.findings)) if one.severity != "note"]
    said, left = _by_codes(grave[:MOST_TOLD]), fit.verdict.not_at
    but = f", not at {enumerated(left, fit.data.input_unit)}" if left else ""
    if not fit.verdict.usable:
        return f"stop   {said}"
    return f"usable yes{but}, {f'warned: {said}' if said else 'no warnings'}"


def list_cautions(fit: "Fit") -> list[str]:
    """What of a fit's warnings matters to what is made of it, and what it means, in one line; none without."""
    about = [one for one in fit.verdict.warnings if one.subject in MODEL_PARTS or one.code in MEANT]
    about = sorted(about, key=lambda one: one.code not in MEANT)[: MOST_TOLD + 1]
    return [f"of a fit that warned: {_by_codes(about)}"] if about else []


def values(fit: "Fit") -> list[list[str]]:
    """Heading and rows: T_s, τ1 and τ2 at the lowest, the middle and the highest level; where single steps stand for
    the levels their changes, with dead times where there are any. No rows, no heading."""
    data, steps, plant = fit.data, steps_of_other_shapes(fit), fit.another_plant
    out = data.output_unit
    if plant is not None and plant.tried[0].gain != "curve":
        return [[kind_in_words(plant.tried[0].kind), ""], *map(list, plant_values(plant))]
    if steps:
        late = any(one.dead_time_s for one in steps)
        heading = ["step", f"change [{out}]", "τ1 [s]", "τ2 [s]", *(["dead [s]"] if late else [])]
        rows = [
            [f"{one.from_:.4g} → {one.level:.4g}", *(_with_interval(one, key) for key in ("change", "tau1", "tau2")),
             *([f"{one.dead_time_s:.3g}"] if late else [])]
            for one in _three(steps)
        ]  # fmt: skip
    else:
        names = list(SYMBOLS)[: 2 if fit.plant_ is not None and fit.plant_.kind == "lag" else 3]
        heading = [f"level [{data.input_unit}]", f"T_s [{out}]", "τ1 [s]", "τ2 [s]"][: len(names) + 1]
        levels: Sequence[CurveLevel | FrictionLevel] = fit.level_values
        asked = any(row.ci95 is not None for row in levels)
        rows = [[f"{row.level:.4g}", *(_value(row, name, asked) for name in names)] for row in _three(levels)]
    return [heading, *rows] if rows else []


def steps_of_other_shapes(fit: "Fit") -> "list[StepShape]":
    """The single steps, where no level is fitted, or where most of them ask for a dead time that the models lack."""
    if fit.another_plant is not None:
        return []
    taken_over = fit.plant_ is not None and fit.plant_.dead_time_s > 0
    late = 0 if taken_over else sum(step.dead_time_s > 0 for step in fit.steps)
    return list(fit.steps) if fit.steps and (not fit.level_values or 2 * late > len(fit.steps)) else []


def _three(rows: Sequence[T]) -> list[T]:
    """The first, the middle and the last."""
    return [rows[k] for k in sorted({0, len(rows) // 2, len(rows) - 1})] if rows else []


def _shown(fit: "Fit") -> list[str]:
    """The values as lines, left-aligned."""
    cells = values(fit)
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in cells]


def _fit_pct(fit: "Fit") -> str:
    said = []
    if fit.another_plant is not None:
        said.append(f"plant {fit.another_plant.tried[0].fit_pct or 0.0:.1f} %")
    for name in ("linear",) if said else ("nonlinear", "linear"):
        part = getattr(fit, name)
        if part is not None and part.fit_pct is not None:
            said.append(f"{name} {part.fit_pct:.1f} %")
    percents = [row.fit_pct for row in fit.friction_levels if row.fit_pct is not None]
    if percents:
        said.append(f"levels {' … '.join(f'{one:.1f}' for one in sorted({min(percents), max(percents)}))} %")
    if not said and fit.steps:
        return f"single steps {min(one.fit_pct or 0.0 for one in fit.steps):.1f} % or more"
    return f"{', '.join(said)} (100 % = perfect)" if said else "not known"


def _value(row: "CurveLevel | FrictionLevel", name: str, asked: bool) -> str:
    value = getattr(row, name)
    if value is None or ci95_of(row, name) is not None:
        return _with_interval(row, name)
    return "not estimable" if name != "Ts" and value > ENDLESS_S else f"{value:.3g}" + " (not estimable)" * asked


def _with_interval(row: "CurveLevel | FrictionLevel | StepShape | LevelResponse", name: str) -> str:
    """A value with its interval; a dash where there is none."""
    value = getattr(row, name)
    return "–" if value is None else _with_ends(value, ci95_of(row, name), 3)


def _with_ends(value: float, ends: Interval, digits: int) -> str:
    """`2.1 (1.9 … 2.3)`, or the value alone."""
    both = "" if ends is None else f" ({ends[0]:.{digits}g} … {ends[1]:.{digits}g})"
    return f"{value:.{digits}g}{both}"
