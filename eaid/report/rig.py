"""What rig a result is of: its units and names, and whether it is the clutch that the paper describes."""

from eaid.apparatus import Apparatus
from eaid.results.common import Source
from eaid.results.fit import CurveLevel, Fit, FittedData, FrictionLevel
from eaid.steps.stepset import StepSet

QUANTITIES = {"N·m": "Torque", "N": "Force", "RPM": "Speed", "kPa": "Stress", "°C": "Temperature"}
INPUTS = {"%": "Duty", "N": "Force", "RPM": "Speed", "V": "Voltage", "bar": "Pressure", "A": "Current"}
PAPER = {"clutch": ("%", "N·m"), "friction-force": ("N", "N·m"), "friction-speed": ("RPM", "N·m")}
"""Kind → the units in which the paper's own rig was recorded."""
CONTROLLER_NAMES = {
    "rc": "RC", "pi": "PI", "open-loop": "open loop", "inverse": "model inverse",
    "rc-no-rate": "RC without rate",
}  # fmt: skip


def controller_name(name: str) -> str:
    """A controller's name as a reader knows it."""
    return CONTROLLER_NAMES.get(name, name)


def apparatus_of(data: FittedData) -> Apparatus:
    """The rig that a fit names; one friction surface where a friction rig was fitted and none is told."""
    rig = data.apparatus
    return Apparatus(**{name: getattr(rig, name) for name in rig.__struct_fields__})


def of_the_paper(data: FittedData | StepSet | None, asked: bool | None = None) -> bool:
    """Whether published values belong beside these: units of the paper's rig and kind, or somebody asks for them."""
    if data is None:
        return False
    return (data.input_unit, data.output_unit) == PAPER[data.kind] if asked is None else asked


def printed_head(kind: str, units: tuple[str, str], asked: bool | None = None) -> str:
    """Head of the column of published values: empty where they do not belong; with their units beside other ones."""
    paper = PAPER[kind]
    if asked is False or (asked is None and units != paper):
        return ""
    return "published" if units == paper else f"published ({', '.join(paper)})"


def overlaid(data: FittedData, asked: bool | None = None) -> bool:
    """Whether published curves may be drawn over ours: only in the same units."""
    return asked is not False and of_the_paper(data)


def quantity(unit: str) -> str:
    """Axis label of an output, by its unit."""
    name = QUANTITIES.get(unit, "Output")
    return f"{name} ({unit})" if unit else name


def over(unit: str) -> str:
    """Label of the axis that levels run along."""
    name = INPUTS.get(unit, "Level")
    return f"{name} ({unit})" if unit else name


def level_text(level: float, unit: str) -> str:
    """A level as written beside its curve: 40 %, 86 N; the bare number where levels have no unit."""
    return (f"{level:.3g} {unit}" if level < 1000 else f"{level:.0f} {unit}").rstrip()


def rate(input_unit: str, output_unit: str) -> str:
    """Unit of b0, output per second and input."""
    return f"{output_unit}/(s·{input_unit or 'input'})"


def gain(input_unit: str, output_unit: str) -> str:
    """Unit of B = 1/b0."""
    return f"{input_unit or 'input'}·s/({output_unit or 'output'})"


def level_values(fit: Fit) -> tuple[FrictionLevel | CurveLevel, ...]:
    """T_s, τ1 and τ2 with their intervals over the level: of the levels stepped to from rest, each by itself; of logs
    fitted as recorded, those of the model's curves."""
    if fit.recorded is not None and fit.nonlinear is not None and fit.nonlinear.curves:
        return fit.nonlinear.curves
    return tuple(row for row in fit.friction_levels if row.from_ == 0)


def rising(sources: tuple[Source, ...]) -> tuple[Source, ...]:
    """The runs that rise."""
    return tuple(one for one in sources if one.edge != "falling")
