"""What is to be known of the results, as findings, by the part of the page that they belong to."""

from collections.abc import Mapping

from eaid.errors import on_command_line
from eaid.findings import Finding, merged, ranked, say
from eaid.report.results import Results

MODELS = {"friction": "friction curves", "nonlinear": "nonlinear model", "linear": "linear model", "release": "release"}
# Findings of single runs that say how far the model is from them
ABOUT_THE_CURVE = {"shape-misses", "other-shape-fits-better"}
MOST = 3  # Findings of a part that are shown; the rest are folded


Known = Mapping[str, tuple[Finding, ...]]  # Part of the page → its findings, the gravest first, those of one code once


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
