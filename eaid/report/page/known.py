"""What is to be known of the results, as findings, by the part of the page that they belong to."""

from collections.abc import Mapping

from eaid.errors import on_command_line
from eaid.findings import Finding, merged, ranked, say
from eaid.report.results import Results

MODELS = {"friction": "friction curves", "nonlinear": "nonlinear model", "linear": "linear model", "release": "release"}
ABOUT_THE_CURVE = {"shape-misses", "other-shape-fits-better"}
"""Findings of single runs that say how far the model is from them."""
MOST = 3
"""Findings of a part that are shown; the rest are folded."""


Known = Mapping[str, tuple[Finding, ...]]
"""Part of the page → its findings, the gravest first, those of one code once."""


def known(results: Results) -> Known:
    """All findings of the results, sorted."""
    found: dict[str, list[Finding]] = {"data": [], "model": [], "controller": [], "replay": []}
    for data in results.data:
        found["data"] += data.result.all_findings
    for fit in results.fits:
        for one in fit.result.findings:
            of_the_model = one.subject in MODELS or one.subject == "fit" or one.code in ABOUT_THE_CURVE
            found["model" if of_the_model else "data"].append(one)
    for gains in results.gains:
        found["controller"] += gains.result.findings
    for replay in results.replays:
        found["replay"] += replay.result.findings
    for part, group in found.items():  # each once: a fit repeats what its data already said
        found[part] = list({(one.code, one.subject, one.levels): one for one in group}.values())
    return {part: merged(ranked(group)) for part, group in found.items()}


def sentence(one: Finding, of_data: bool = False) -> str:
    """A finding in words, with a capital and a full stop, options as the command line has them."""
    said = on_command_line(say(one)).rstrip(".")
    about = f"{MODELS[one.subject]}: " if one.subject in MODELS else ""
    if of_data and one.subject != "data" and one.subject not in said:
        return f"{one.subject}: {said}."  # a run, by its name
    text = f"{about}{said}"
    return f"{text[:1].upper() if text[:1] not in 'τφρα' else text[:1]}{text[1:]}."


GLOSSARY = (
    ("duty u", "share of the PWM period during which voltage is on, in percent"),
    ("level", "one value of the input that was stepped to"),
    ("T_s", "steady output: what a step reaches after a long time"),
    ("τ1, τ2", "fast and slow time constant: after τ, 63 % of that part's change is done"),
    ("C", "share of the output that changes with the fast constant"),
    ("C_f", "coefficient of friction: friction stress over normal stress"),
    ("B, B_m, B_M", "input per rate of output, 1/b0 of the linear model; its least and largest value over the levels"),
    ("RMSE", "root mean square error: a typical size of the residuals (measured minus model), in the data's unit"),
    ("fit %", "100 for a model on the data, 0 for one no better than their mean"),
    ("sd", "standard deviation: how far repeats scatter around their mean"),
    ("95 % interval", "range that holds the true value in 95 of 100 such experiments, if the model is right"),
    ("joint, levels first", "all levels fitted at once; a size for each level first, then curves"),
    ("RC, PI", "robust controller; controller that uses the error and its integral"),
    ("ρ, α, φ, Q_M, ε, γ", "terms of the robust controller's condition for stability, inequality (15)"),
    ("open loop", "the input follows from the model alone, without looking at the output"),
    ("replay", "a computed experiment: a controller on the fitted model"),
    ("margin", "how much gain, phase lag or delay a control loop bears before it is unstable"),
    ("p", "probability of so large a difference by chance alone"),
    ("coherence", "share of the output that a linear answer to the input explains, 0 to 1"),
    ("free run, one step", "the model goes on from itself; from each measured sample to the next"),
    ("synthetic", "computed from a known model with noise added"),
    ("published", "Feizi, Atashzar, Kermani and Patel, IEEE Trans. Med. Robotics and Bionics, 2022"),
)
"""Words and their meaning, for a reader who knows clutches but not our names."""
