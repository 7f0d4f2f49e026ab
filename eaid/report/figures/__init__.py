"""Every figure: its name, its title, what is to be seen in it, what it needs, and the function that describes it."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from operator import attrgetter, methodcaller
from typing import Any

from eaid.report.figures import replays, residuals, sessions, steps, values
from eaid.report.panels import Sheet
from eaid.report.results import Results
from eaid.results.fit import Fit


@dataclass(frozen=True)
class Drawing:
    """One figure of the catalogue."""

    name: str  # File name without ending
    title: str
    sees: str  # Its caption; the numbers stand in the tables
    # What is given to `describe`, in this order; the figure is left out where one of them is None
    needs: tuple[Callable[[Results], Any], ...]
    describe: Callable[..., Sheet | None]
    # Whether it shows the fit of the clutch, or what was made from it; a mark of that fit goes on it then
    of_the_fit: bool = True

    def sheet(self, results: Results) -> Sheet | None:
        """The figure, or None where its data were not given."""
        given = [need(results) for need in self.needs]
        return None if any(one is None for one in given) else self.describe(*given)


def _all(results: Results) -> Results:
    return results


def _recorded(results: Results) -> Fit | None:
    return next((one.result for one in results.fits if one.result.recorded is not None), None)


_fit, _of_data, _replay = (partial(methodcaller, name) for name in ("fit", "data_of", "replay"))
_CLUTCH = _fit("clutch")


TRENDS = "The values of each level, their 95 % intervals and their trend."
FREE_RUN = "The model is driven by the recorded input alone (free run); of many logs three are drawn."
TRACKED_CAPTION = "Errors are reference minus output; a shaded band holds 95 % of drawn plants, where there are any."

# In the order of the page
CATALOGUE: tuple[Drawing, ...] = (
    Drawing("fig02_pwm", "Fig. 2 · One PWM period",
        "The voltage alternates in sign, so that no charge builds up; the ideal torque does not depend on the sign.",
        (_all,), values.pwm_period, of_the_fit=False),
    Drawing("fig06_hold_and_release", "Fig. 6 · Output while held and after release",
        "Lost: from the peak to the end of the hold. Left: at the end of the record.",
        (attrgetter("main_data"),), steps.hold_and_release, of_the_fit=False),
    Drawing("recorded_logs", "Logs as recorded", FREE_RUN, (_recorded,), replays.recorded_logs),
    Drawing("fig07_nonlinear_model", "Fig. 7 · Nonlinear model",
        "Broad: mean of the repeats, shaded ± one standard deviation (sd); dashed: the model, where one was fitted.",
        (_of_data("clutch"), _all), steps.nonlinear_model),
    Drawing("residuals", "Residuals",
        "What the model leaves: over time; with itself a lag later, shaded where white noise lies in 19 of 20 lags; "
        "against the input.", (attrgetter("main_fit"), _all),
        lambda fit, results: residuals.residual_panels(fit, results.main_data)),
    Drawing("model_over_duty", "Parameters over the level",
        "Line: the model's curve. Dots: the values of the levels with their 95 % intervals.", (_CLUTCH,),
        values.polynomials),
    Drawing("level_steps", "Single steps", "Each step from its own start; dashed: the fitted curve.",
        (_all,), steps.level_step_panels, of_the_fit=False),
    Drawing("fig08_linear_model", "Fig. 8 · Linear model",
        "Broad: mean of the repeats; dashed: one model of all levels, left out where it ends below zero.",
        (_of_data("clutch"), _CLUTCH), steps.linear_model),
    Drawing("fig09_shear_per_field", "Fig. 9 · Shear stress over the electric field",
        "The square is this clutch at its highest level; the lines are half, equal and twice its stress per field.",
        (_CLUTCH,), values.shear_per_field),
    Drawing("fig03_friction_steps", "Fig. 3 · Friction steps", "Broad: mean of the repeats; dashed: the model, if any.",
        (_all,), steps.friction_steps, of_the_fit=False),
    Drawing("fig04_friction_over_stress", "Fig. 4 · Friction over the load", TRENDS, (_fit("friction-force"),),
        values.trends, of_the_fit=False),
    Drawing("fig05_friction_over_speed", "Fig. 5 · Friction over the rotation speed", TRENDS, (_fit("friction-speed"),),
        values.trends, of_the_fit=False),
    Drawing("fig12_multisine", "Fig. 12 · Sum of sines", TRACKED_CAPTION, (_replay("multisine"),), replays.tracked),
    Drawing("own_reference", "Your own reference", TRACKED_CAPTION, (_replay("reference"),), replays.tracked),
    Drawing("fig11_steps", "Fig. 11 · Steps", TRACKED_CAPTION, (_replay("steps"),), replays.tracked),
    Drawing("fig13_sweep", "Fig. 13 · Sines of rising frequency",
        "Amplitude of the output against the reference, and the error, at each frequency.",
        (_replay("sweep"),), replays.sweep_panels),
    Drawing("log_replay", "Recorded input through the model", FREE_RUN, (_replay("log"),), replays.recorded_input),
    Drawing("sessions_chart", "Sessions of the rig",
        "Left: each session's gain over the common one; shaded: where the next one lies at the middle level in 19 of "
        "20 cases (at other levels it may reach further).", (_all,), sessions.chart, of_the_fit=False),
    Drawing("sessions_compared", "Sessions compared",
        "T_s of the sessions on top of each other, and by what factor A lies above the others, with 95 % intervals.",
        (_all,), sessions.sessions_compared, of_the_fit=False),
    Drawing("fig16_rehab", "Fig. 16 · Elbow rehabilitation", "The ground changes with the mode of the exercise.",
        (_replay("rehab"),), replays.training),
    Drawing("fig17_rehab_errors", "Fig. 17 · Position error by mode",
        "Without the first seconds of each mode; whiskers to 1.5 times the box.", (_replay("rehab"),),
        replays.error_boxes),
)  # fmt: skip
