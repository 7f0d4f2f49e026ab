"""The page of all results: its grammar, its parts, its numbers, its words; what a script's own results show."""

import hashlib
import json
import re
import shlex

import html5lib
import numpy as np
import pytest

import eaid
from eaid.plant.linear import LinearPlant
from eaid.report.page import signs
from eaid.report.tables import Column, Name, Table
from eaid.report.tables.gains import comparison
from eaid.results.gains import Compared, Gains, Replayed
from eaid.shown import number

from ..conftest import LINEAR, PLANT, loaded, made_once

FIGURES = {
    "fig02_pwm", "fig03_friction_steps", "fig04_friction_over_stress", "fig05_friction_over_speed",
    "fig06_hold_and_release", "fig07_nonlinear_model", "fig08_linear_model", "fig09_shear_per_field", "fig11_steps",
    "fig12_multisine", "fig13_sweep", "fig16_rehab", "fig17_rehab_errors",
}  # fmt: skip
"""The names that the contract lists."""
PARTS = ["summary", "data", "model", "controller", "replay", "rehabilitation", "appendix"]


def strict(html):
    """Raises where the page breaks the HTML standard's grammar."""
    html5lib.HTMLParser(strict=True).parse(html)


def test_the_page_is_valid_small_and_asks_for_nothing_outside(whole):
    with pytest.raises(html5lib.html5parser.ParseError):
        strict("<!DOCTYPE html><title>x</title><p></b><table><p></table>")
    strict(whole.html)
    assert whole.path.stat().st_size < 4e6
    ids = [one.get("id") for one in whole.root.iter() if one.get("id")]
    assert len(ids) == len(set(ids)) and {one.get("href") for one in whole.of("a")} <= {f"#{name}" for name in ids}
    for one in whole.root.iter():
        for key in ("src", "href", "srcset", "data", "action", "poster"):
            assert (one.get(key) or "#").startswith(("data:", "#")) or not one.get(key), (one.tag, one.get(key))
    (policy,) = [one.get("content") for one in whole.of("meta") if one.get("http-equiv")]
    assert policy.startswith("default-src 'none'") and "unsafe-inline' ; script" not in policy
    assert re.search(r"script-src 'sha256-\S+' 'sha256-\S+';", policy)


def test_every_figure_of_the_contract_is_there_with_its_words(whole):
    assert set(whole.captions) >= FIGURES
    for name in whole.captions:
        assert (whole.path.parent / "figures" / f"{name}.png").stat().st_size > 5000
    for image in whole.of("img"):
        assert len(image.get("alt")) > 40 and image.get("width") and image.get("height")


def test_the_parts_stand_in_their_order_a_picture_first_and_count_what_they_fold(whole):
    assert [one.get("id") for one in whole.of("section")] == PARTS
    assert [one.get("href") for one in whole.of("a")][1:8] == [f"#{name}" for name in PARTS]
    for name in PARTS[1:-1]:
        part = whole.html.split(f'<section id="{name}">')[1].split("</section>")[0]
        shown = re.sub(r"<details.*?</details>", "", part, flags=re.DOTALL)
        assert part.index("<figure") < part.index("<table") and shown.count("<table>") <= 1, name
    for fold in re.findall(r"<details.*?</details>", whole.html, re.DOTALL):
        count = re.search(r'class="count">(?:(\d+) figures?)?(?: and )?(?:(\d+) tables?)?', fold)
        if count is not None and any(count.groups()):
            assert [int(n or 0) for n in count.groups()] == [fold.count("<figure"), fold.count("<table>")]


def test_the_page_says_where_its_numbers_come_from(whole, files):
    assert re.search(r"<title>[^<]*\(synthetic data\)</title>", whole.html) and "No rig recorded them" in whole.text
    assert whole.title == "Electroadhesive clutch" and whole.chips[1:3] == ["% → N·m", "5 levels, 20 … 100 %"]
    given = {row[0]: row[-1] for row in whole.rows("Files")}
    for path in files.values():
        assert given[str(path)] == hashlib.sha256(path.read_bytes()).hexdigest()


def test_the_summary_and_the_tables_say_what_the_files_say(whole, files):
    fit, gains = (json.loads(files[name].read_text(encoding="utf-8")) for name in ("clutch.json", "gains.json"))
    levels = fit["friction"]["levels"]
    heads, *rows = whole.numbers["Values with 95 % intervals"]
    assert heads == ["level (%)", "Ts (N·m)", "τ1 (s)", "τ2 (s)"] and [row[0] for row in rows] == ["20", "60", "100"]
    for row, one in zip(rows, (levels[0], levels[2], levels[-1]), strict=True):
        for cell, name in zip(row[1:], ("Ts", "tau1", "tau2"), strict=True):
            low, high = one["ci95"][name]
            assert cell == f"{one[name]:.3g} ({low:.3g} … {high:.3g})"  # as the terminal has it
    assert f"usable, fits {number(fit['nonlinear']['fit_pct'], 3)} % (100 % = perfect); " in whole.lights[1][1]
    worst = gains["margins"]["worst"]
    rows = {row[0]: row[1:] for row in whole.numbers["Controllers"]}
    for name, title in (("rc", "RC"), ("pi", "PI, designed")):
        assert rows[title][:2] == [number(worst[name][key], 3) for key in ("gain_db", "phase_deg")]
    done = gains["replayed"]
    times = done["equal_pi"]["max_abs_error_nm"] / done["rc"]["max_abs_error_nm"]
    assert f"At equal margins a PI leaves {times:.1f} times RC's largest error" in whole.text
    rows = whole.rows("Single levels")
    for row, one in zip(rows, fit["friction"]["levels"], strict=True):
        wanted = [one["Ts"], one["tau1"], one["tau2"]]
        assert [row[0], *row[1:6:2]] == [f"{one['level']:g}", *(number(x) for x in wanted)]
        assert row[2] == " … ".join(number(end, 3) for end in one["ci95"]["Ts"])
    steps = [command.split()[1] for _why, command in whole.steps]
    assert steps == ["plan", "export"]  # no gains mend the duty limit: none are offered


def test_what_to_do_next_works_in_any_folder_and_overwrites_nothing(tmp_path, monkeypatch, report):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my fit.json").write_text(json.dumps({"schema": "eaid/fit/2", **OTHER_RIG}), encoding="utf-8")
    for name, others in (("plan.csv", ()), ("plan-2.csv", ("plan.csv",)), ("plan-3.csv", ("plan.csv", "plan-2.csv"))):
        for other in others:
            (tmp_path / other).touch()
        steps = report("my fit.json", "--figures", "fig02").steps
        (command,) = [line for _why, line in steps if line.startswith("eaid plan")]
        assert shlex.split(command) == ["eaid", "plan", f"{tmp_path}/my fit.json", "-o", f"{tmp_path}/{name}"]


def test_a_warning_is_counted_once_and_where_it_is_shown(whole):
    for name, light in zip(("data", "model"), whole.lights, strict=False):
        part = whole.html.split(f'<section id="{name}">')[1].split("</section>")[0]
        own = re.sub(r"<details[^>]*>\s*<summary><b>Friction.*?</details>", "", part, flags=re.DOTALL)
        told = re.search(r"(\d+) warnings?:", light[1])
        assert int(told[1] if told else 0) == own.count('<li class="care">'), name
    assert "of 10 runs" in whole.lights[0][1] or whole.lights[0][1].startswith("10 runs")  # a release is no run more


@pytest.mark.slow
def test_figures_of_another_rig_are_counted_from_one(long, report):
    page = report(*long)
    titles = [caption.split(" · ")[0] for caption in page.captions.values()]
    assert titles == [f"Figure {k}" for k in range(1, len(titles) + 1)] and len(titles) > 3
    assert not any("Fig. " in caption for caption in page.captions.values())


@pytest.mark.parametrize(
    ("designed", "said"),
    [
        ((9.0, 60.0, 0.8), "At margins no smaller the designed PI leaves 0.8 times RC's"),
        ((None, 60.0, 0.8), "At margins no smaller the designed PI leaves 0.8 times RC's"),  # no limit to its gain
        ((7.0, 60.0, 0.8), "At equal margins a PI leaves 1.5 times RC's"),  # better, but nearer to the edge
        ((9.0, 60.0, 2.0), "At equal margins a PI leaves 1.5 times RC's"),
    ],
)  # fmt: skip
def test_rc_is_held_against_the_best_pi_that_is_as_safe(designed, said):
    rows = {"rc": (8.0, 50.0, 1.0), "equal_pi": (8.0, 50.0, 1.5), "equal_pi_feedforward": (8.0, 50.0, 1.0)}
    made = {name: Compared(**dict(zip(("gain_db", "phase_deg", "max_abs_error_nm"), one, strict=True)), stable=True)
            for name, one in {**rows, "pi": designed}.items()}  # fmt: skip
    assert comparison(Gains(LinearPlant(1.0, 1.0, 0.0), replayed=Replayed(**made))).startswith(said)


def test_one_minus_sign_and_no_interval_without_width():
    assert signs("drift -0.5 N (-3e-05 … 2) in log -x a-1") == "drift −0.5 N (−3e−05\u00a0…\u00a02) in log -x a-1"
    assert signs(Name("run -1")) == "run -1"
    both = Table("", "", (Column("ends"),), (((0.181, 0.181),), ((6.4791, 6.4799),)))
    assert both.texts == (("not known",), ("6.479 … 6.480",))


def test_tables_one_to_four_stand_beside_the_published_values(whole, files):
    assert {"Table I", "Table II", "Table III", "Table IV"} <= set(whole.tables)
    fit = json.loads(files["clutch.json"].read_text(encoding="utf-8"))
    rows = {row[0]: row for row in whole.rows("Table III")}
    assert rows["a0"][1:4] == ["τ1", "0.00674", number(fit["nonlinear"]["tau1"][0])] and rows["C"][2] == "0.85"
    assert whole.rows("Table I")[0][2] == "0.0944 σ − 0.0896"
    assert whole.rows("Table IV")[0][:2] == ["Bm", "12.4"]
    assert whole.rows("Linear model")[0][:3] == ["a0", "1.36", number(fit["linear"]["a0"])]


def test_live_plots_hold_what_was_measured_and_the_model(whole, files):
    lines, data = whole.lines("fig07_nonlinear_model"), eaid.load(files["clutch.h5"])
    fit, level = eaid.load(files["clutch.json"]), data.levels[2]
    (name,) = [one for one in lines if one.startswith("60 %, model, RMSE 0.")]
    x, y = lines[name]
    assert y == pytest.approx(fit.predict(duty=60, t=x.astype(float).tolist()).to_numpy()[:, 0], abs=1e-4)
    x, y = lines["60 %, measured"]
    assert y == pytest.approx(np.interp(x, level.time_s, level.mean), abs=1e-3)
    assert y.max() == pytest.approx(level.mean.max(), rel=1e-6)  # thinned, and yet the extremes are kept


@pytest.mark.slow
def test_the_same_files_give_the_same_bytes(files, whole, report):
    assert report(*files.values()).html == whole.html
    fit = files["friction-force.json"]
    pages = [report(fit, "--format", "pdf,svg").path.parent / "figures" for _ in range(2)]
    made = sorted(path.name for path in pages[0].iterdir())
    assert {f"fig04_friction_over_stress.{kind}" for kind in ("pdf", "png", "svg")} <= set(made)
    assert all((pages[0] / name).read_bytes() == (pages[1] / name).read_bytes() for name in made)


HOSTILE = "<script>alert(1)</script><img src=x onerror=alert(2)>&\"'{{7*7}}"


@pytest.mark.slow
def test_hostile_text_is_shown_and_never_run(files, tmp_path, report):
    fit = json.loads(files["clutch.json"].read_text(encoding="utf-8"))
    fit["data"] |= {"synthetic": HOSTILE, "inputs": [{"path": HOSTILE, "sha256": HOSTILE}], "input_unit": HOSTILE}
    fit["nonlinear"]["warnings"] = [HOSTILE]
    fit["data"]["sources"][0]["run"] = HOSTILE
    path = tmp_path / "fit <b>&'\" $(x).json"
    path.write_text(json.dumps(fit), encoding="utf-8")
    page = report(path, files["clutch.h5"])
    strict(page.html)
    assert HOSTILE in page.text and not [one for one in page.of("img") if one.get("src") == "x"]
    assert "alert(1)</script>" not in page.html and "onerror=alert(2)>" not in page.html
    assert "49" not in re.findall(r"'(\d+)'", page.html)
    assert "'\\''" in page.text or '"\'"' in page.text  # quoted for the shell, too
    for figure in page.live:
        assert all("<" not in name and "@" not in name and "{" not in name for name in page.lines(figure))


LEVELS = [{"level": u, "Ts": Ts, "tau1": tau, "tau2": slow, "ci95": {"Ts": [0.95 * Ts, 1.05 * Ts], "tau2": None}}
          for u, Ts, tau, slow in ((100.0, 1.0, 0.1, 5.0), (300.0, 2.0, 0.2, 2.9e7))]  # fmt: skip
VOLTS = {"kind": "clutch", "input_unit": "V", "output_unit": "N", "levels": [100.0, 300.0]}
OTHER_RIG = {"schema": "eaid/fit/2", "data": VOLTS, "converged": True, "friction": {"C": 0.85, "levels": LEVELS},
             "linear": {**LINEAR, "per_level": [{"level": 100.0, "a0": 1.0, "gain": 2.0, "B": 3.0}]},
             "nonlinear": {"tau1": [0.1, 0, 0], "tau2": [2.0, 0, 0], "Ts": [0.5, 0, 0, 0], "C": 0.85,
                           "u_range": [100.0, 300.0]}}  # fmt: skip


def test_another_rig_has_its_own_units_and_no_published_values(report_of):
    page = report_of(OTHER_RIG)
    assert page.title == "Step responses" and page.chips == ["V → N", "2 levels, 100 … 300 V"]
    (_heads, lowest, highest) = page.numbers["Values with 95 % intervals"]
    assert lowest[:2] == ["100", "1 (0.95 … 1.05)"] and highest[:2] == ["300", "2 (1.9 … 2.1)"]
    assert highest[3] == "not estimable" and lowest[2] == "0.1 (not estimable)"
    assert page.rows("Single levels")[1][6] == "not known"  # never one without width
    assert page.tables["Linear model"][0] == ["symbol", "ours", "unit"]
    assert [row[-1] for row in page.rows("Linear model")][:3] == ["1/s", "N/(s·V)", "N/s"]
    assert "B (V·s/(N))" in page.tables["Input gain of each level"][0]
    assert not any("published" in head for rows in page.tables.values() for head in rows[0])


def test_trends_are_written_by_their_form(report_of):
    forms = {"Ts": ("linear", [0.0944, -0.0896]), "tau1": ("merged-exponential", [5.4, 0.1, -0.0101]),
             "tau2": ("double-exponential", [6.01, -0.431, -0.11, 0.0492])}  # fmt: skip
    trends = {name: {"form": form, "over": "stress_kpa", "coefficients": c} for name, (form, c) in forms.items()}
    data = {"kind": "friction-force", "input_unit": "N", "output_unit": "N·m"}
    friction = {"C": 0.85, "levels": LEVELS, "trends": trends}
    page = report_of({"schema": "eaid/fit/2", "data": data, "friction": friction})
    shown = {row[0]: row[4] for row in page.rows("Table I")}
    assert shown == {"Ts": "0.09440 σ − 0.08960", "Cf": "not fitted", "τ1": "(5.400 + 0.1000 σ) e−0.01010 σ",
                     "τ2": "6.010 e−0.4310 σ − 0.1100 e0.04920 σ"}  # fmt: skip
    assert "T<sub>s</sub>" in page.html and "e<sup>−0.01010 σ</sup>" in page.html


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (1.84393, 4, "1.844"), (-2.42, 3, "−2.42"), (0, 4, "0"), (0.0, 4, "0"), (21, 4, "21"), (-3, 1, "−3"),
        (1.85e-7, 3, "1.85e−7"), (5.375e5, 4, "5.375e5"), (0.0782825, 4, "0.07828"), (99999.0, 3, "99999"),
        (None, 4, "–"), (float("nan"), 4, "–"), (True, 4, "yes"), ("text", 4, "–"),
    ],
)  # fmt: skip
def test_numbers_as_text(value, digits, text):
    assert number(value, digits) == text


def finding(severity, subject, code="test"):
    return {"code": code, "severity": severity, "subject": subject, "levels": [5.0], "values": {}, "text": "said"}


@pytest.mark.parametrize(
    ("findings", "converged", "wanted"),
    [
        ([], True, ["good", "good", "none"]),
        ([finding("stop", "nonlinear"), finding("note", "linear")], True, ["good", "bad", "none"]),
        ([finding("caution", "linear")], True, ["good", "care", "none"]),
        ([finding("note", "release")], True, ["good", "good", "none"]),
        ([finding("stop", "a")], True, ["bad", "bad", "none"]),  # a run that the fit rests on
        ([finding("caution", "a", "shape-misses")], True, ["good", "care", "none"]),  # that is the model's matter
        ([], False, ["good", "bad", "none"]),
    ],
)
def test_lights_are_as_grave_as_what_was_found(findings, converged, wanted, report_of):
    for one in findings:
        one["values"] = {"worst": 1.0, "share_pct": 20.0}
    fit = {"schema": "eaid/fit/2", "converged": converged, "linear": LINEAR, "findings": findings,
           "data": {"kind": "clutch", "sources": [{"run": "a", "level": 10.0}]}}  # fmt: skip
    page = report_of(fit)
    assert [grade for grade, _text in page.lights] == wanted
    of_data = [one["severity"] for one in findings if one["subject"] == "a" and one["code"] == "test"]
    assert page.lights[0][1] == f"1 run; {'1 stop: test at 5 %' if 'stop' in of_data else 'no warning'}"


def test_what_was_found_of_a_second_fit_stands_under_its_own_name(report_of):
    """A clutch's page said that its plant is two lags in series, which was the other's."""
    plain = {"schema": "eaid/fit/2", "linear": LINEAR, "data": {"kind": "clutch"}}
    first, second = ({**plain, "findings": [finding("caution", "linear", f"{whose}-matter")]} for whose in
                     ("own", "the-others"))  # fmt: skip
    page = report_of(first, second)
    own, folded = page.html.split("Clutch, ", 1)
    assert "own-matter" in own and "the-others-matter" not in own and "the-others-matter" in folded
    assert page.lights[1][1] == "usable; 1 warning: own matter at 5 %"


GAINS = {"schema": "eaid/gains/1", "model": {"a0": 1.8, "b0": 0.08, "c0": -1.3}, "pi": {"K_P": 21.0, "K_I": 360.0}}


@pytest.mark.parametrize(
    ("holds", "unit", "text", "grade"),
    [
        ([True, True], "%", "yes", "good"),
        ([False, True], "%", "NO (φ)", "care"),
        ([False, False], "%", "NO (φ, duty limit)", "care"),
        ([False, False], "V", "NO (φ, input limit)", "care"),
        ([True, None], "%", "not known (duty limit)", "good"),
    ],
)
def test_one_verdict_on_the_guarantee_and_what_to_do_next(holds, unit, text, grade, report_of):
    rows = [{"name": name, "holds": one, "needed": 37.5, "available": 17.8, "unit": unit}
            for name, one in zip(("phi", "duty-limit"), holds, strict=True)]  # fmt: skip
    whole = False if False in holds else None if None in holds else True
    worst = {"rc": {"gain_db": 16.2, "phase_deg": 78.1}, "pi": {"gain_db": 42.7, "phase_deg": 31.5}}
    gains = {**GAINS, "guarantee": {"holds": whole, "conditions": rows}, "margins": {"worst": worst}}
    page = report_of({"schema": "eaid/fit/2", "converged": True, "linear": LINEAR}, gains)
    told, said = page.lights[2]
    assert told == grade and said.startswith(f"guarantee {text.partition(' (φ')[0]}")
    assert ("φ allows the model's drift term 17.8 of the 37.5" in said) == (holds[0] is False)
    beyond = holds[1] is False
    have = "what you have: gain margin 16.2 dB, phase margin 78.1°"
    assert (f"No gains mend the actuator's range; {have}" in said) == beyond
    assert page.numbers["Controllers"][1:] == [["PI", "42.7", "31.5", "–"]]
    verdict = {True: "holds", False: "does not hold", None: "not known"}
    shown = [row[2:] for row in page.rows("What the guarantee needs")]
    assert shown == [["37.5", "17.8", unit, verdict[one]] for one in holds]
    commands = [command.split()[1] for _why, command in page.steps]
    mended = holds[0] is False and not beyond
    assert commands == (["tune-rc"] if mended else []) + ["simulate", "export"]
    assert not mended or ("--phi data" in page.steps[0][1] and "--alpha" not in page.steps[0][1])


@made_once
def gains_of(fit):
    """gains.json of a script's fit."""
    return eaid.tune_rc(loaded(fit)).to_dict()


def test_rc_stands_beside_a_pi_of_its_own_margins(report_of):
    """… with and without its feedforward."""
    fit = {"schema": "eaid/fit/2", "converged": True, "linear": LINEAR, "nonlinear": PLANT}
    gains = gains_of(fit)
    page = report_of(fit, gains)
    assert "eaid export knows rc, pi-feedforward and pi; the other rows run in replays alone" in page.text
    _heads, *rows = page.numbers["Controllers"]
    for row, name in zip(rows, ("rc", "equal_pi_feedforward", "equal_pi", "pi", "paper_pi"), strict=True):
        one = gains["replayed"][name]
        assert row[1:] == [number(one[key], 3) for key in ("gain_db", "phase_deg", "max_abs_error_nm")], name


@pytest.mark.parametrize("wrong", [{}, {"solver": {"converged": False}}, {"b0": -1.0}, {"a0": -1.0}])
def test_no_command_is_offered_that_would_be_refused(wrong, report_of):
    page = report_of({"schema": "eaid/fit/2", "converged": True, "linear": {**LINEAR, **wrong}})
    assert [command.split()[1] for _why, command in page.steps] == ([] if wrong else ["tune-rc"])


def test_what_no_command_mends_is_said_in_its_place(report_of, tmp_path):
    fit = {"schema": "eaid/fit/2", "converged": True, "linear": LINEAR, "nonlinear": PLANT}
    gains = gains_of(fit)
    (tmp_path / "a.csv").touch()
    values = {"times": 9.0, "e": 0.0, "low": -0.3, "high": 0.3, "worst": 50.0, "of": 1, "lost_pct": 25.0,
              "samples": 2, "value": 9.0, "at_s": 2.0, "unit": "%"}  # fmt: skip
    found = {code: {"code": code, "subject": "data", "severity": severity, "values": values} for code, severity in
             (("rise-of-the-rig", "caution"), ("output-decays-under-hold", "caution"), ("spikes", "stop"))}  # fmt: skip
    for code, one in found.items():
        page = report_of({**fit, "command": [str(tmp_path / "a.csv")], "findings": [one]}, gains)
        said, offered = page.text, [command.split()[1] for _why, command in page.steps]
        assert ("Record steps on a stand" in said) == (code == "rise-of-the-rig") and "plan" not in offered
        assert ("Take peak, slip and held output" in said) == (code == "output-decays-under-hold")
        assert ("export" in offered) == (code == "output-decays-under-hold")
        mended = [command for _why, command in page.steps if "--repair" in command]
        wanted = [["fit", str(tmp_path / "a.csv"), "--repair"]] * (code == "spikes")
        assert [line.split()[1:4] for line in mended] == wanted


@pytest.mark.parametrize(
    ("short", "laws"), [("", None), ("rc", "pi,inverse,plant"), ("pi", "rc,pi-feedforward,inverse,plant")]
)
def test_gains_short_of_margin_are_not_sent_to_the_rig(short, laws, report_of):
    """None at all where neither controller has 6 dB and 45°."""
    fit = {"schema": "eaid/fit/2", "converged": True, "linear": LINEAR, "nonlinear": PLANT}
    gains = gains_of(fit)
    values = {"unit": "%", "enough_db": 6.0, "enough_deg": 45.0, "gain_db": 1.0, "phase_deg": 30.0, "of": 1}
    told = [{"code": "margin-missed", "subject": one, "severity": "caution", "levels": [30.0], "values": values}
            for one in ("rc", "pi")]  # fmt: skip
    page = report_of(fit, {**gains, "findings": [one for one in told if one["subject"] == short]})
    command = page.steps[-1][1].split()
    assert command[1] == "export" and command[5:-2] == (["--law", laws] if laws else [])
    assert "export" not in str(report_of(fit, {**gains, "findings": told}).steps)


def test_table_iv_and_what_follows_from_it(report_of):
    rc = {"K_P": 4.5, "K_D": 3.0, "B_hat": 12.8, "rho": {"constant": 15.5, "slope": 10.3}, "epsilon": 0.5,
          "gamma": 50.0, "Q": [[1.0, 0.5], [0.5, 1.0]], "B_m": 8.6, "B_M": 41.4, "phi": 0.1}  # fmt: skip
    page = report_of({**GAINS, "rc": rc})
    rows = {row[0]: row for row in page.rows("Table IV")}
    assert rows["Bm"][1:3] == ["12.4", "8.600"] and rows["φ"][1:3] == ["0.0500", "0.1000"] and rows["QM"][2] == "–"
    assert rows["B̂"][1:3] == ["12.5", "12.80"] and rows["ρ, constant"][1:3] == ["10.81", "15.50"]


def test_a_word_longer_than_a_file_name_stands_as_it_was_typed(report_of):
    long = "belt == 'slipped' or " * 30
    values = {"of": 1, "samples": 2, "value": 9.0, "at_s": 2.0, "unit": "%"}
    found = {"code": "spikes", "subject": "data", "severity": "stop", "values": values}
    fit = {"schema": "eaid/fit/2", "converged": True, "linear": LINEAR, "command": ["a.csv", "--where", long],
           "findings": [found]}  # fmt: skip
    assert any(long in shlex.split(command) for _why, command in report_of(fit).steps)
