"""Every figure: its name, its title, what it needs, and the function that describes it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter, methodcaller
from typing import Any

from eaid.report.figures import replays, steps, values
from eaid.report.panels import Ready
from eaid.report.results import Results

Need = Callable[[Results], Any]


@dataclass(frozen=True)
class Row:
    """One figure of the catalogue."""

    name: str  # File name without ending
    title: str
    # What is given to `describe`, in this order; the figure is left out where one of them is None
    needs: tuple[Need, ...]
    describe: Callable[..., Ready | None]
    # Whether it shows the fit of the clutch, or what was made from it; a mark of that fit goes on it then
    of_the_fit: bool = True

    def ready(self, results: Results) -> Ready | None:
        """The figure, or None where its data were not given."""
        given = [need(results) for need in self.needs]
        made = None if any(one is None for one in given) else self.describe(*given)
        title = self.title if results.of_paper else self.title.split(" · ")[-1]
        return made and replace(made, title=made.title or title)


def _all(results: Results) -> Results:
    return results


_fit, _data, _replay = (partial(methodcaller, name) for name in ("fit", "data_of", "replay"))
_CLUTCH = _fit("clutch")


# In the order of the page
FIGURES: tuple[Row, ...] = (
    Row("fig02_pwm", "Fig. 2 · One PWM period", (_all,), values.pwm_period, of_the_fit=False),
    Row("fig06_hold_and_release", "Fig. 6 · Output while held and after release",
        (attrgetter("main_data"),), steps.hold_and_release, of_the_fit=False),
    Row("recorded_logs", "Logs as recorded", (attrgetter("recorded"),), replays.recorded_logs),
    Row("fig07_nonlinear_model", "Fig. 7 · Nonlinear model", (_data("clutch"), _all), steps.nonlinear_model),
    Row("model_over_duty", "Parameters over the level", (_CLUTCH,), values.polynomials),
    Row("level_steps", "Steps from level to level", (_all,), steps.level_steps, of_the_fit=False),
    Row("fig08_linear_model", "Fig. 8 · Linear model", (_data("clutch"), _CLUTCH), steps.linear_model),
    Row("fig09_shear_per_field", "Fig. 9 · Shear stress over the electric field", (_CLUTCH,),
        values.shear_per_field),
    Row("fig03_friction_steps", "Fig. 3 · Friction steps", (_all,), steps.friction_steps, of_the_fit=False),
    Row("fig04_friction_over_stress", "Fig. 4 · Friction over the normal stress", (_fit("friction-force"),),
        values.trends, of_the_fit=False),
    Row("fig05_friction_over_speed", "Fig. 5 · Friction over the rotation speed", (_fit("friction-speed"),),
        values.trends, of_the_fit=False),
    Row("fig12_multisine", "Fig. 12 · Sum of sines", (_replay("multisine"),), replays.tracking),
    Row("own_reference", "Your own reference", (_replay("reference"),), replays.tracking),
    Row("fig11_steps", "Fig. 11 · Steps", (_replay("steps"),), replays.tracking),
    Row("fig13_sweep", "Fig. 13 · Sines of rising frequency", (_replay("sweep"),), replays.sweep),
    Row("log_replay", "Recorded input through the model", (_replay("log"),), replays.recorded_input),
    Row("fig16_rehab", "Fig. 16 · Elbow rehabilitation", (_replay("rehab"),), replays.training),
    Row("fig17_rehab_errors", "Fig. 17 · Position error by mode", (_replay("rehab"),), replays.errors),
)  # fmt: skip
