"""How often a nominal 95 % interval holds the truth: `python -m benchmarks.coverage [SETS] [ROW…]`.

Each row is kept in `$TMPDIR/eaid-coverage` as it is done; `python -m benchmarks.coverage write` puts all of them into
docs/uncertainty.md.

Each set is 10 levels of the reference plant, 2,000 samples over 20 s, three runs a level. Per run a gain factor
1 + 0.03 N and exp(0.05 N) on τ1; white noise 0.01 N·m, AR(1) ripple of 1 % (0.05 s) and rotor ripple of 1 % (10 RPM,
its phase from run to run). The truth of the linear model, which is wrong by design, is its fit to the plant itself.
Where the C held is not the plant's, the levels' own aim is counted too: the fit, at that C, to the plant itself.
"""

import pickle
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from eaid.apparatus import Apparatus
from eaid.arrays import Array
from eaid.fitting.fit import fit
from eaid.models import friction
from eaid.models.nonlinear import at_duty
from eaid.models.parameters import REFERENCE_PLANT, Friction
from eaid.results.common import Interval
from eaid.results.fit import Fit, FitOptions
from eaid.steps.stepset import Level, StepSet
from eaid.uncertainty.intervals import with_intervals

LEVELS = np.arange(10.0, 101.0, 10.0)
SAMPLES, RECORD_S = 2000, 20.0
COLOUR_S = 0.05
WIDE = 0.30
"""Half-width beyond which an interval of a level is flagged: coverage of τ2 is counted below it."""
ROTOR_HZ = 10 / 60


@dataclass(frozen=True)
class Variant:
    """How the sets of one row are made."""

    name: str
    runs: int = 3
    white_nm: float = 0.01
    sweeps: bool = False
    """One gain for all levels of a repeat."""
    doubled_below: float = 0.0
    """Scatter twice as large up to this duty [%]."""
    share: float = 0.85
    """C of the plant; the fit holds 0.85."""


VARIANTS: dict[str, Variant] = {
    "base": Variant("three runs a level"),
    "single": Variant("one run a level", runs=1),
    "sweeps": Variant("three sweeps, one gain each", sweeps=True),
    "low": Variant("scatter doubled up to 30 % duty", doubled_below=30.0),
    "white": Variant("white noise × 5", white_nm=0.05),
    "share": Variant("C of the plant 0.88, held at 0.85", share=0.88),
}


def plant(duty_pct: float, variant: Variant) -> Friction:
    """The true curve of one level."""
    return replace(at_duty(REFERENCE_PLANT, duty_pct), C=variant.share)


def coloured(random: np.random.Generator, runs: int, n: int, dt_s: float) -> Array:
    """AR(1) noise of unit variance and memory `COLOUR_S`, shape (runs, n)."""
    keep = np.exp(-dt_s / COLOUR_S)
    white = random.standard_normal((runs, n))
    white[:, 1:] *= np.sqrt(1 - keep * keep)
    for k in range(1, n):
        white[:, k] += keep * white[:, k - 1]
    return white


def stepset(levels: tuple[Level, ...]) -> StepSet:
    return StepSet("clutch", "%", "N·m", Apparatus(), levels)


def one_set(
    seed: int, variant: Variant, samples: int = SAMPLES, levels: Array = LEVELS, record_s: float = RECORD_S
) -> StepSet:
    """One simulated set; the same seed gives the same set."""
    random = np.random.default_rng([seed, 20260])
    t = np.arange(samples) * (record_s / samples)
    sweep = random.standard_normal(variant.runs)
    colour = coloured(random, variant.runs * len(levels), samples, record_s / samples).reshape(
        len(levels), variant.runs, -1
    )
    made = []
    for i, duty in enumerate(levels):
        size = 2.0 if duty <= variant.doubled_below else 1.0
        true = plant(float(duty), variant)
        runs = []
        for r in range(variant.runs):
            gain = 1 + 0.03 * (sweep[r] if variant.sweeps else size * random.standard_normal())
            own = replace(true, Ts=true.Ts * gain, tau1=true.tau1 * np.exp(0.05 * size * random.standard_normal()))
            rotor = np.sin(2 * np.pi * (ROTOR_HZ * t + random.random()))
            torque = friction.step_response(own, t) * (1 + 0.01 * colour[i, r] + 0.01 * rotor)
            runs.append(torque + variant.white_nm * random.standard_normal(samples))
        names = tuple(f"{duty:g}-{r}" for r in range(variant.runs))
        made.append(Level(float(duty), t, np.array(runs), names))
    return stepset(tuple(made))


def clean_levels(variant: Variant, samples: int = SAMPLES, levels: Array = LEVELS) -> tuple[Level, ...]:
    """The plant itself, without noise or scatter."""
    t = np.arange(samples) * (RECORD_S / samples)
    return tuple(
        Level(float(u), t, friction.step_response(plant(float(u), variant), t)[None], ("plant",)) for u in levels
    )


def truth(variant: Variant, samples: int = SAMPLES, levels: Array = LEVELS) -> dict[str, Any]:
    """What the intervals should hold: the plant's own values, and the linear fit to the plant without noise."""
    curves = [plant(float(duty), variant) for duty in levels]
    clean = clean_levels(variant, samples, levels)
    found = fit(stepset(clean), FitOptions(models=("friction", "linear")))
    linear, friction_part = found.linear, found.friction
    assert linear is not None and friction_part is not None
    return {
        "Ts": np.array([curve.Ts for curve in curves]),
        "tau1": np.array([curve.tau1 for curve in curves]),
        "tau2": np.array([curve.tau2 for curve in curves]),
        **{name: getattr(linear.parameters, name) for name in ("a0", "b0", "c0")},
        "C": variant.share,
        "aim": {name: [getattr(row.curve, name) for row in friction_part.levels] for name in ("Ts", "tau1", "tau2")},
        "B": np.array([row.B for row in linear.per_level]),
        "B_m": linear.bounds.B_m,
        "B_M": linear.bounds.B_M,
    }


def inside(interval: Any, value: float) -> float:
    """1 or 0; NaN where no interval was given (flagged)."""
    if interval is None:
        return np.nan
    return float(interval[0] <= value <= interval[1])


def doubted(interval: Interval) -> bool:
    """Whether an interval is not quoted, or wide."""
    return interval is None or interval[0] <= 0 or np.log(interval[1] / interval[0]) > 2 * np.log1p(WIDE)


def hits(found: Fit, true: dict[str, Any]) -> dict[str, list[float]]:
    """Which intervals hold the truth: by group and parameter, one entry a level (one alone for the pooled ones)."""
    result: dict[str, list[float]] = {}
    assert found.nonlinear is not None and found.linear is not None and found.uncertainty is not None
    share, linear = found.uncertainty.share, found.linear
    for name in ("Ts", "tau1", "tau2"):
        values = true[name]
        if found.friction is not None:
            own = [getattr(row.ci95, name) for row in found.friction.levels]
            for label, aim in (("level", values), ("aim", true["aim"][name])):
                pairs = zip(own, aim, strict=True)
                result[f"{label} {name}"] = [np.nan if doubted(ci) else inside(ci, v) for ci, v in pairs]
            asked = {row.level: getattr(row.ci95, name) for row in (share.at_estimate if share else ())}
            result[f"asked {name}"] = [inside(asked.get(u), v) for u, v in zip(LEVELS, values, strict=True)]
        for label, part in (("joint", found.nonlinear), ("two-stage", found.nonlinear.two_stage)):
            if part is not None and part.curves:
                rows = [getattr(row.ci95, name) for row in part.curves]
                result[f"{label} {name}"] = [inside(ci, v) for ci, v in zip(rows, values, strict=True)]
    if share is not None and share.rejected is not None:
        result["asked C"] = [inside(share.ci95, true["C"])]
        result["asked rejected"] = [float(share.rejected)]
        result["asked told"] = [float(bool(share.matters))]
    for name in ("a0", "b0", "c0"):
        result[f"linear {name}"] = [inside(getattr(linear.ci95, name), true[name])]
    result["linear B"] = [
        inside(row.ci95.B if row.ci95 else None, b) for row, b in zip(linear.per_level, true["B"], strict=True)
    ]
    for name in ("B_m", "B_M"):
        assert linear.bounds is not None
        result[f"linear {name}"] = [inside(getattr(linear.bounds.ci95, name), true[name])]
    return result


def widths(found: Fit) -> dict[str, float]:
    """Mean half-widths [%] of the levels' own intervals and of the two-stage curves."""
    result = {}
    assert found.friction is not None and found.nonlinear is not None
    two = found.nonlinear.two_stage
    groups = {"level": found.friction.levels, "two-stage": two.curves if two is not None else ()}
    for label, rows in groups.items():
        for name in ("Ts", "tau1", "tau2"):
            own = [ends for row in rows if (ends := getattr(row.ci95, name)) is not None]
            result[f"{label} {name}"] = float(np.mean([50 * np.log(b / a) for a, b in own])) if own else np.nan
    return result


def both_ways(seed: int, variant: Variant) -> tuple[Fit, Fit]:
    """A set fitted, with our intervals and the textbook's."""
    made = one_set(seed, variant)
    fitted = fit(made)
    ways = (FitOptions(ci=ci, estimator="joint") for ci in ("robust", "white"))
    ours, textbook = (with_intervals(made, fitted, way) for way in ways)
    return ours, textbook


@dataclass(frozen=True)
class Coverage:
    """One row of the table."""

    ours: dict[str, Array]
    """Coverage [%] by group and parameter, one entry a level."""
    textbook: dict[str, Array]
    widths: dict[str, float]
    """Mean half-width [%]."""
    flagged: float
    """Share of τ2 intervals of single levels that carry a flag [%]."""


def measure(variant: Variant, sets: int, first: int = 0) -> Coverage:
    """Coverage over `sets` simulated sets."""
    true = truth(variant)
    ours, textbook, reach = [], [], []
    for seed in range(first, first + sets):
        robust, white = both_ways(seed, variant)
        ours.append(hits(robust, true))
        textbook.append(hits(white, true))
        reach.append(widths(robust))
    flagged = float(np.mean([np.isnan(one["level tau2"]) for one in ours]) * 100)
    return Coverage(
        {key: _mean([one[key] for one in ours if key in one]) for key in ours[0]},
        {key: _mean([one[key] for one in textbook if key in one]) for key in textbook[0]},
        {key: float(np.nanmean([one[key] for one in reach])) for key in reach[0]},
        flagged,
    )


def _mean(rows: list[list[float]]) -> Array:
    values = np.array(rows)
    known = np.isfinite(values)
    counted = known.sum(axis=0)
    share = 100 * np.where(known, values, 0).sum(axis=0) / np.maximum(counted, 1)
    return np.asarray(np.where(counted >= 0.2 * len(values), share, np.nan))  # mostly flagged: nothing to count


BANDS = {
    "Ts": ((93, 97), (91, 98)),
    "tau1": ((93, 97), (91, 98)),
    "tau2": ((92, 97), (89, 98)),
}
SINGLE_BANDS = {"Ts": (92, 97), "tau1": (92, 97), "tau2": (90, 98)}
"""With one run a level the curves are held to these, on the mean."""


def outside_bands(name: str, coverage: Coverage) -> list[str]:
    """Where a row leaves the bands it is held to; with the wrong C no row is."""
    said = []
    for parameter, (mean, each) in BANDS.items():
        for group in ("level", "two-stage"):
            values = coverage.ours.get(f"{group} {parameter}")
            if values is None or name == "share" or (name == "single" and group == "level"):
                continue
            values = values[np.isfinite(values)]
            low, high = SINGLE_BANDS[parameter] if name == "single" else mean
            if not low <= values.mean() <= high:
                said.append(f"{group} {parameter}: mean {values.mean():.1f} outside {low}–{high}")
            if name != "single" and not (each[0] <= values.min() and values.max() <= each[1]):
                said.append(f"{group} {parameter}: {values.min():.1f}–{values.max():.1f} outside {each[0]}–{each[1]}")
    said += [
        f"linear {p}: {coverage.ours[f'linear {p}'][0]:.1f} outside 92–98"
        for p in ("a0", "b0", "c0", "B_m", "B_M")
        if not 92 <= coverage.ours[f"linear {p}"][0] <= 98
    ]
    return said


def table(rows: dict[str, Coverage], sets: int) -> str:
    """The table as Markdown: mean over the levels (least–largest of any one level)."""

    def cell(part: dict[str, Array], key: str) -> str:
        if key not in part:
            return "–"
        v = part[key]
        if np.isnan(v).all():
            return "flagged"
        v = v[np.isfinite(v)]
        return f"{v[0]:.0f}" if len(v) == 1 else f"{v.mean():.0f} ({v.min():.0f}–{v.max():.0f})"

    lines = [f"Coverage [%] of nominal 95 % intervals, {sets} sets a row", ""]
    for group, names in (
        ("level", ("Ts", "tau1", "tau2")),
        ("two-stage", ("Ts", "tau1", "tau2")),
        ("joint", ("Ts", "tau1", "tau2")),
        ("linear", ("a0", "b0", "c0", "B", "B_m", "B_M")),
    ):
        both = group != "two-stage"  # the textbook has no two-stage estimate
        lines += [f"| {group} | " + " | ".join(f"{n}, ours | {n}, textbook" if both else n for n in names) + " |"]
        lines += ["|---" * (1 + (1 + both) * len(names)) + "|"]
        for name, row in rows.items():
            cells = [
                " | ".join(cell(part, f"{group} {n}") for part in ((row.ours, row.textbook) if both else (row.ours,)))
                for n in names
            ]
            lines += [f"| {VARIANTS[name].name} | " + " | ".join(cells) + " |"]
        lines += [""]
    lines += ["| C asked of the runs | C | the C held is rejected | and told | Ts at it | tau1 at it | tau2 at it | "]
    lines[-1] += "the fit's own aim: Ts | tau1 | tau2 |"
    lines += ["|---" * 10 + "|"]
    for name, row in rows.items():
        asked = ("asked C", "asked rejected", "asked told", "asked Ts", "asked tau1", "asked tau2")
        cells = [cell(row.ours, key) for key in (*asked, "aim Ts", "aim tau1", "aim tau2")]
        lines += [f"| {VARIANTS[name].name} | " + " | ".join(cells) + " |"]
    lines += [""]
    keys = ("level Ts", "level tau1", "level tau2", "two-stage Ts", "two-stage tau1", "two-stage tau2")
    lines += ["| mean half-width [%] | " + " | ".join(keys) + " | τ2 of a level flagged [%] |"]
    lines += ["|---" * (2 + len(keys)) + "|"]
    for name, row in rows.items():
        cells = [f"{row.widths[key]:.1f}" for key in keys] + [f"{row.flagged:.0f}"]
        lines += [f"| {VARIANTS[name].name} | " + " | ".join(cells) + " |"]
    return "\n".join(lines)


KEPT = Path(tempfile.gettempdir()) / "eaid-coverage"
DOCS = Path(__file__).parents[1] / "docs" / "uncertainty.md"
BEGIN, END = "<!-- benchmarks.coverage: begin -->\n", "<!-- benchmarks.coverage: end -->"


def write() -> None:
    """All kept rows as the table of docs/uncertainty.md; a row of fewer sets than the others says so."""
    kept = {name: pickle.loads((KEPT / name).read_bytes()) for name in VARIANTS if (KEPT / name).exists()}
    missing = set(VARIANTS) - set(kept)
    if missing:
        sys.exit(f"rows not measured yet: {', '.join(sorted(missing))}")
    sets = max(count for count, _ in kept.values())
    for name, (count, _) in kept.items():
        if count < sets:
            VARIANTS[name] = replace(VARIANTS[name], name=f"{VARIANTS[name].name} ({count} sets)")
    text = DOCS.read_text()
    before, after = text[: text.index(BEGIN) + len(BEGIN)], text[text.index(END) :]
    DOCS.write_text(before + table({name: row for name, (_, row) in kept.items()}, sets) + "\n" + after)


def main() -> None:
    if sys.argv[1:] == ["write"]:
        write()
        return
    sets = int(sys.argv[1]) if len(sys.argv) > 1 else 500
    names = sys.argv[2:] or list(VARIANTS)
    rows: dict[str, Coverage] = {}
    KEPT.mkdir(exist_ok=True)
    for name in names:
        rows[name] = measure(VARIANTS[name], sets)
        (KEPT / name).write_bytes(pickle.dumps((sets, rows[name])))
        for word in outside_bands(name, rows[name]):
            print(f"{name}: {word}", file=sys.stderr)
        print(f"{name}: done", file=sys.stderr, flush=True)
    print(table(rows, sets))


if __name__ == "__main__":
    main()
