"""What is to be known of the results, as findings, by the part of the page that they belong to."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

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


GLOSSARY: tuple[tuple[str, str, str], ...] = (
    ("duty u", r"\bduty\b|\bDuty\b", "share of the PWM period during which voltage is on, in percent"),
    ("PWM", r"\bPWM\b", "pulse-width modulation: voltage switched on and off many times a second"),
    ("level", r"\b[Ll]evels?\b", "one value of the input that was stepped to"),
    ("T_s", r"T_s\b", "steady output: what a step reaches after a long time"),
    ("τ1, τ2", r"τ[12]", "fast and slow time constant: after τ, 63 % of that part's change is done"),
    ("C", r"\bC =|share of the fast part", "share of the output that changes with the fast constant"),
    ("C_f", r"C_f\b", "coefficient of friction: friction stress over normal stress"),
    ("B, B_m, B_M", r"\bB_[mM]\b|input gain B\b", "input per rate of output, 1/b0 of the linear model; its least and "
     "largest value over the levels"),
    ("residual", r"[Rr]esiduals?\b", "measured value minus the model's"),
    ("RMSE", r"\bRMSE\b", "root mean square error: a typical size of the residuals, in the unit of the data"),
    ("fit %", r"\bfit \(%\)|\bfit %", "100 for a model on the data, 0 for one no better than their mean"),
    ("sd", r"\bsd\b", "standard deviation: how far repeats scatter around their mean"),
    ("95 % interval", r"95 %", "range that holds the true value in 95 of 100 such experiments, if the model is right"),
    ("autocorrelation", r"autocorrelation", "how much a residual resembles itself a little later"),
    ("joint, levels first", r"\blevels first\b", "all levels fitted at once; a size for each level first, then curves"),
    ("RC, PI", r"\bRC\b", "robust controller; controller that uses the error and its integral"),
    ("ρ, α, φ, Q_M, ε, γ", r"[ραφ]\b|Q_M", "terms of the robust controller's condition for stability, inequality (15)"),
    ("‖ξ‖", r"‖ξ‖", "size of the error and its integral taken together"),
    ("open loop", r"open loop", "the input follows from the model alone, without looking at the output"),
    ("replay", r"\b[Rr]eplays?\b", "a computed experiment: a controller on the fitted model"),
    ("overshoot, settling time", r"[Oo]vershoot", "how far a step goes beyond its goal; until it stays "
     "within 2 % (edges of a log: 5 %)"),
    ("χ², AICc", r"AICc", "closeness in units of scatter; closeness with a price for each value fitted"),
    ("margin", r"[Mm]argins?\b", "how much gain, phase lag or delay a control loop bears before it is unstable"),
    ("p", r"\bp, ", "probability of so large a difference by chance alone"),
    ("coherence", r"[Cc]oherence", "share of the output that a linear answer to the input explains, 0 to 1"),
    ("free run, one step", r"[Ff]ree.run", "the model goes on from itself; from each measured sample to the next"),
    ("harmonics", r"[Hh]armonics", "output at frequencies, or of a size, that no linear system makes of the input"),
    ("dB", r"\bdB\b", "20 times the decimal logarithm of a ratio; 0 is equal, −6 is half"),
    ("synthetic", r"[Ss]ynthetic", "computed from a known model with noise added"),
    ("published", r"[Pp]ublished", "Feizi, Atashzar, Kermani and Patel, IEEE Trans. Med. Robotics and Bionics, 2022"),
)  # fmt: skip
"""Word, how it is recognised, meaning; for a reader who knows clutches but not our names."""


@dataclass
class Terms:
    """Which words have been explained so far on a page."""

    known: set[str] = field(default_factory=set)

    def first_in(self, texts: Iterable[str]) -> tuple[tuple[str, str], ...]:
        """The words that appear in these texts for the first time, with their meaning."""
        text = " ".join(texts)
        found = [(word, says) for word, sign, says in GLOSSARY if word not in self.known and re.search(sign, text)]
        self.known.update(word for word, _ in found)
        return tuple(found)
