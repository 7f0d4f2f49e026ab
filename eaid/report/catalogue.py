"""Every figure of the page: its name, what the eye should see, what it needs, who makes that, and who draws it."""

from collections.abc import Callable
from dataclasses import dataclass

from eaid.report.available import (
    Ready,
    bands,
    compare_ready,
    counted_from,
    errors_ready,
    friction_steps_ready,
    guarantee_ready,
    hold_ready,
    linear_ready,
    log_ready,
    nonlinear_ready,
    over_speed_ready,
    over_stress_ready,
    pwm_ready,
    replay_ready,
    residuals_ready,
    sweep_ready,
    training_ready,
    with_ready,
)
from eaid.report.figures import clutch, replays, shear
from eaid.report.results import Results


@dataclass(frozen=True)
class Row:
    """One figure of the catalogue."""

    name: str
    """File name without ending."""
    title: str
    sees: str
    """What the eye should see, in one sentence."""
    section: str
    """data, models, gains, replays, rehab or compare: where on the page it stands."""
    ready: Callable[[Results], Ready | None]
    """The figure, or None where its data were not given."""
    made_by: str
    """The command that makes what is missing."""
    of_the_fit: bool = True
    """Whether it shows the fit of the clutch, or what was made from it; a mark of that fit goes on it then."""


FIGURES: tuple[Row, ...] = (
    Row(
        "fig02_pwm",
        "Fig. 2 · One PWM period",
        "Voltage alternates in sign, so no charge builds up, while the ideal torque does not care about the sign.",
        "data",
        pwm_ready,
        "eaid fit clutch.h5",
        of_the_fit=False,
    ),
    Row(
        "fig06_hold_and_release",
        "Fig. 6 · Torque while held and after release",
        "A good drive holds its torque while the input is on and leaves nothing behind afterwards.",
        "data",
        hold_ready,
        "eaid ingest LOGS (with the release recorded) -o data.h5",
        of_the_fit=False,
    ),
    Row(
        "fig03_friction_steps",
        "Fig. 3 · Friction steps",
        "Torque rises fast to most of its final value, then creeps; each dashed curve should lie on its solid one.",
        "models",
        friction_steps_ready,
        "eaid ingest FRICTION-LOGS -o friction-force.h5",
        of_the_fit=False,
    ),
    Row(
        "fig04_friction_over_stress",
        "Fig. 4 · Friction over the normal stress",
        "Steady torque grows along a line, while both time constants are long at low stress and short at high stress.",
        "models",
        over_stress_ready,
        "eaid fit friction-force.h5 -o friction-force.json",
        of_the_fit=False,
    ),
    Row(
        "fig05_friction_over_speed",
        "Fig. 5 · Friction over the rotation speed",
        "Steady torque dips and then rises slowly with speed; the time constants change little beyond the "
        "slowest speeds.",
        "models",
        over_speed_ready,
        "eaid fit friction-speed.h5 -o friction-speed.json",
        of_the_fit=False,
    ),
    Row(
        "fig07_nonlinear_model",
        "Fig. 7 · Nonlinear model",
        "Each dashed model curve should stay inside the shaded band of its level, the mean ± sd of its repeats. "
        "The static figure writes each level's root-mean-square error in N·m behind its duty; in the live one the "
        "pointer reads it off the model's curve.",
        "models",
        nonlinear_ready,
        "eaid ingest CLUTCH-LOGS -o clutch.h5",
    ),
    Row(
        "model_over_duty",
        "Model parameters over the duty",
        "The joint curve should pass through the intervals of the single levels; where it does not, the "
        "polynomial is too stiff or the runs scatter.",
        "models",
        lambda r: with_ready(r, "nonlinear", clutch.polynomials),
        "eaid fit clutch.h5 -o fit.json",
    ),
    Row(
        "fig08_linear_model",
        "Fig. 8 · Linear model",
        "One straight-line model for all duties meets the data at two duties only and misses everywhere else, "
        "which is what the robust controller has to make up for.",
        "models",
        linear_ready,
        "eaid fit clutch.h5 -o fit.json",
    ),
    Row(
        "residuals_nonlinear",
        "What the nonlinear model leaves",
        "Residuals should scatter around zero without a trend, and their autocorrelation should fall to zero "
        "within a short lag.",
        "models",
        residuals_ready("nonlinear", "clutch"),
        "eaid fit clutch.h5 -o fit.json",
    ),
    Row(
        "residuals_linear",
        "What the linear model leaves",
        "The residuals are large and all of one sign within a level: the linear model is a tool for control "
        "design, not a description.",
        "models",
        residuals_ready("linear", "clutch"),
        "eaid fit clutch.h5 -o fit.json",
    ),
    Row(
        "residuals_friction_force",
        "What the friction curves leave, over force",
        "Each level has a curve of its own, so only noise and the rotor's ripple should be left.",
        "models",
        residuals_ready("friction", "friction-force"),
        "eaid fit friction-force.h5 -o friction-force.json",
        of_the_fit=False,
    ),
    Row(
        "residuals_friction_speed",
        "What the friction curves leave, over speed",
        "Each level has a curve of its own, so only noise and the rotor's ripple should be left.",
        "models",
        residuals_ready("friction", "friction-speed"),
        "eaid fit friction-speed.h5 -o friction-speed.json",
        of_the_fit=False,
    ),
    Row(
        "fig09_shear_per_field",
        "Fig. 9 · Shear stress over the electric field",
        "The square is this clutch at its highest duty; the further above a line, the more friction per field.",
        "models",
        lambda r: with_ready(r, "nonlinear", shear.shear_per_field),
        "eaid fit clutch.h5 -o fit.json",
    ),
    Row(
        "input_gain",
        "Input gain of each level",
        "B is far from constant over the duty; its least and largest value are what the robust gains are made for.",
        "gains",
        lambda r: with_ready(r, "linear", clutch.input_gain),
        "eaid fit clutch.h5 -o fit.json",
    ),
    Row(
        "fig11_steps",
        "Fig. 11 · Steps",
        "The robust controller (RC) should reach each step with less overshoot than the PI; the last fall is "
        "slow for both, as the duty cannot go below zero.",
        "replays",
        replay_ready("steps", lambda r: replays.steps(r.traces), with_error=False),
        "eaid simulate fit.json --gains gains.json --scenario steps -o steps.h5",
    ),
    Row(
        "fig12_multisine",
        "Fig. 12 · Sum of sines",
        "The RC's error band is several times narrower than the PI's.",
        "replays",
        replay_ready("multisine", lambda r: replays.tracking(r.traces, counted_from(r), bands(r)), with_error=True),
        "eaid simulate fit.json --gains gains.json --scenario multisine -o multisine.h5",
    ),
    Row(
        "fig13_sweep",
        "Fig. 13 · Sines of rising frequency",
        "A good controller stays at 0 dB as far to the right as the duty allows; the PI overshoots near 0.6 Hz.",
        "replays",
        sweep_ready,
        "eaid simulate fit.json --gains gains.json --scenario sweep -o sweep.h5",
    ),
    Row(
        "own_reference",
        "Your own reference",
        "The same view for the reference that was given.",
        "replays",
        replay_ready("reference", lambda r: replays.tracking(r.traces, counted_from(r), bands(r)), with_error=True),
        "",
    ),
    Row(
        "guarantee_in_replay",
        "What the robust term has to cover",
        "The guarantee holds in this replay where the solid line lies above the dashed one.",
        "replays",
        guarantee_ready,
        "eaid simulate fit.json --gains gains.json --scenario multisine -o multisine.h5",
    ),
    Row(
        "log_replay",
        "Recorded duty through the model",
        "The model, driven by the recorded duty, should lie on the recorded torque, in rise and release.",
        "replays",
        log_ready,
        "eaid simulate fit.json --log clutch.h5 -o log.h5",
    ),
    Row(
        "fig16_rehab",
        "Fig. 16 · Elbow rehabilitation",
        "Rendered torque lies on the desired torque in all three modes, while the position error grows with "
        "the stiffness.",
        "rehab",
        training_ready,
        "eaid simulate fit.json --gains gains.json --scenario rehab -o rehab.h5",
    ),
    Row(
        "fig17_rehab_errors",
        "Fig. 17 · Position error by mode",
        "The hard mode has the largest position error; whether soft and assisted differ is for the tests below to say.",
        "rehab",
        errors_ready,
        "eaid simulate fit.json --gains gains.json --scenario rehab -o rehab.h5",
    ),
    Row(
        "compare",
        "Two fits over each other",
        "Points whose intervals do not touch differ by more than repeats explain.",
        "compare",
        compare_ready,
        "eaid report A/fit.json B/fit.json",
    ),
)
"""In the order of the page."""
