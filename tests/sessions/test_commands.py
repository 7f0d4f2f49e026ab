"""The commands: five questions answered from the terminal alone, the page, logs of several sittings, following."""

import re
import shlex
import threading
import time
from glob import glob
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.text import Text
from scipy.signal import lfilter

import eaid
from eaid.report.figures.sessions import sessions_compared
from eaid.report.paper import figure_of, look
from eaid.report.results import gathered
from eaid.sessions import follow

CLUTCH = sorted(Path(__file__).parents[3].glob("*/realdata/ea-clutch"))  # Of Rauf and Follmer, not in this repository
SIMULATED, OF_A_CLUTCH = (
    (Path(__file__).parents[2] / "docs/sessions.md").read_text(encoding="utf-8").split("## Logs of several days")
)


def blocks(page):
    """The command lines of a page, with what they print."""
    return re.findall(r"^```\n\$ eaid (.*?)^```", page, re.MULTILINE | re.DOTALL)


def shows(run_eaid, block):
    """Run a command that stands in the docs: it prints what is shown, … for any rest, blanks count once."""
    line, *shown = block.splitlines()
    ran = run_eaid(*shlex.split(line), "--force")
    printed = [" ".join(one.split()) for one in ran.out.splitlines()]
    for one in filter(None, shown):
        wanted = re.compile(re.escape(" ".join(one.split())).replace("…", ".*"))
        assert any(wanted.fullmatch(row) for row in printed), (one, printed)
    return ran


@pytest.fixture(scope="module")
def folder(tmp_path_factory, fits, make):
    where = tmp_path_factory.mktemp("rig")
    for name, fit in fits.items():
        fit.save(where / f"{name}.json")
    for name, frame in make(90, 0.5, 0.1, levels=(40.0,), repeats=1).items():
        frame.round(6).to_csv(where / f"{name}.csv", index=False)
    eaid.tune_rc(fits["s1"]).save(where / "gains.json")
    eaid.sessions(sorted(where.glob("s?.json"))).save(where / "rig.json")
    return where


@pytest.fixture(autouse=True)
def _inside(folder, monkeypatch):
    monkeypatch.chdir(folder)


def test_five_questions_are_answered_from_the_terminal(folder, run_eaid):
    told = run_eaid("compare", "s0.json", "s1.json", "s2.json", "--gains", "gains.json", "--force")
    assert told.code == 0, told.err
    assert "moved   A against B: T_s" in told.out and "% at" in told.out  # has it changed, and by how much?
    assert "retune  yes" in told.out and "next    eaid tune-rc s0.json" in told.out  # must I retune?
    assert (told.out + told.err).count("next") == 1
    told = run_eaid("sessions", *(f"s{k}.json" for k in range(6)), "-o", "rig.json", "--force")
    assert told.code == 0, told.err
    assert "advice  sessions, not repeats" in told.out and "first a reference step at" in told.out  # what do I record?
    told = run_eaid("today", "rig.json", "s90_40_0.csv", "-o", "today.json", "--force")
    assert told.code == 0, told.err
    assert "today   T_s within ×/÷" in told.out and "next    eaid tune-rc today.json" in told.out  # how sure today?


def test_the_docs_show_what_is_printed(folder, run_eaid, fits):
    """docs/sessions.md: six sessions by the days of their fits."""
    for day, (name, fit) in zip(("mon", "tue", "wed", "thu", "fri", "sat"), fits.items(), strict=True):
        (folder / f"{day}.json").write_bytes((folder / f"{name}.json").read_bytes())
        if day == "fri":
            eaid.tune_rc(fit).save(folder / "gains-fri.json")
    for block in blocks(SIMULATED):
        shows(run_eaid, block.replace("gains.json", "gains-fri.json").replace("step_40", "s90_40_0"))


@pytest.mark.slow
@pytest.mark.skipif(not CLUTCH, reason="no folder with the logs of the real clutch lies beside the repository")
def test_levels_of_a_real_clutch_from_three_sittings_are_told_apart_and_no_reference_step_is_promised(
    run_eaid, tmp_path, monkeypatch
):
    """docs/sessions.md, by the commands that `fit` offers for its parts."""
    monkeypatch.chdir(tmp_path)
    Path("logs").symlink_to(CLUTCH[0])
    reading = ("--columns", 'time=Time,output="Load Cell"', "--units", "time=us,input=V,output=N", "--repair",
               "--name-pattern", "_V={level}_", "--step-at", "2", "--until", "5")  # fmt: skip
    told = run_eaid("fit", "logs", *reading, "--ci", "none", "-o", "all.json", "-v")
    commands = re.findall(r"eaid (fit logs/.*?json)", told.err.replace(" --ci none", ""))
    assert len(commands) == 3
    for command in commands:
        run_eaid(*(one for word in shlex.split(command) for one in sorted(glob(word)) or [word]))
    t_s = {row.level: row.Ts for k in (1, 2) for row in eaid.load(f"{k}.json").level_values}
    assert t_s[250.0] == pytest.approx(t_s[225.0], rel=0.04)  # what the days hide
    (block,) = blocks(OF_A_CLUTCH)
    ran = shows(run_eaid, block)
    assert "levels and sessions are confounded" in ran.err and "one step" not in ran.out
    refused = run_eaid("compare", "1.json", "2.json")
    assert refused.code == 3 and "shares no level with 1.json" in refused.err


def test_a_page_begins_with_the_verdict_and_shows_the_sessions(folder, run_eaid):
    told = run_eaid("compare", "s0.json", "s1.json", "--force")
    (retune,) = [line.removeprefix("retune  ") for line in told.out.splitlines() if line.startswith("retune")]
    for file, said, figure in (("rig.json", "6 sessions: the next one", "sessions_chart"),
                               ("compare.json", "A against B", "sessions_compared")):  # fmt: skip
        assert run_eaid("report", file, "-o", "page", "--force").code == 0
        page = (folder / "page" / "report.html").read_text()
        assert page.index(said) < page.index('class="picture"') and (folder / f"page/figures/{figure}.png").is_file()
    assert "A: s0.json" in page and "B: s1.json" in page and retune in page and "Do next" in page


def test_names_of_many_sessions_stand_clear_of_the_letters_of_the_panels(fits):
    sheet = sessions_compared(gathered([eaid.compare(*fits.values())]))
    with look():
        figure = figure_of(sheet)
        figure.canvas.draw()
    letters = [one.get_window_extent() for one in figure.findobj(Text) if one.get_text().strip() in ("(a)", "(b)")]
    names = [legend.get_window_extent() for axes in figure.axes if (legend := axes.get_legend())]
    assert len(letters) == 2 and names and not any(one.overlaps(other) for one in letters for other in names)
    shown = [
        [line.get_color() for line in axes.lines if line.get_marker() not in ("None", "_")] for axes in figure.axes
    ]
    assert shown[1] == shown[0][1:]  # B, C … in the colours of their values


@pytest.mark.parametrize(
    ("typed", "code", "said"),
    [
        (("sessions", "s0.json", "s1.json"), 3, "2 sessions: three and more"),
        (("sessions", "s0.json", "s1.json", "gains.json"), 3, "gains.json: is no fit of eaid"),
        (("compare", "s0.json"), 2, "s0.json alone: give another session's fit.json"),
        (("compare", "s0.json", "s0.json"), 2, "s0.json: is given twice; give another session's fit"),
        (("compare", "s0.json", "gains.json"), 2, "gains go behind --gains"),
        (("today", "s0.json", "s90_40_0.csv"), 3, "s0.json: is no rig of eaid"),
        (("fit", "s90_40_0.csv", "--against", "rig.json"), 2, "--against: does nothing without --follow"),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(run_eaid, typed, code, said):
    told = run_eaid(*typed, "-o", "none.json")
    assert told.code == code and said in told.err and told.err.count("error:") == 1


def test_logs_of_several_sittings_are_said_with_an_offer_to_part_them(run_eaid, make, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "logs").mkdir()
    for k, (day, levels) in enumerate({"20241029_1618": (40.0,), "20241103_1442": (20.0, 100.0)}.items()):
        for j, frame in enumerate(make(k, levels=levels, repeats=2).values()):
            file = tmp_path / "logs" / f"{day}{j:02d}_run.csv"
            frame.round(6).rename(columns={"duty_pct": "a b"}).to_csv(file, index=False)
    words = ("--columns", "input=a b", "--units", "input=pct", "--until", "70", "--share", "0.8", "--ci", "none")
    told = run_eaid("fit", "logs", *words, "-v")
    assert "the logs hold 2 sessions (by their dates: 2024-10-29 16:18: 40 %; 2024-11-03 14:42: 20, 100 %)" in told.err
    assert "what differs between their levels may be the sessions" in told.err
    commands = re.findall(r"eaid (fit logs/.*?json)", told.err)
    assert len(commands) == 2
    for command in commands:  # carries all that was typed, and runs as it stands
        ran = run_eaid(*(one for word in shlex.split(command) for one in sorted(glob(word)) or [word]))
        fit = eaid.load(command.split()[-1])
        assert ran.code == 0 and (fit.options.share, fit.options.ci) == (0.8, "none")
        assert fit.options.reading == {"columns": 'input="a b"', "units": "input=pct", "until": 70.0}
    run_eaid("ingest", "logs", *words[:-4], "-o", "data.h5")
    told = run_eaid(
        "fit", "data.h5", "-v", "-o", "of-data.json"
    )  # once the same commands, without what logs are read by
    assert "the logs hold 2 sessions" in told.err and "fit each by itself" in told.err and "part them" not in told.err


def test_a_jump_of_the_idle_tells_sittings_apart_where_names_do_not(make):
    logs = make(1, levels=(40.0, 80.0), repeats=3)
    assert "several-sessions" not in {one.code for one in eaid.read(logs).findings}
    moved = {name: one.assign(torque_nm=one["torque_nm"] + 0.4 * (k > 2)) for k, (name, one) in enumerate(logs.items())}
    (one,) = [one for one in eaid.read(moved).findings if one.code == "several-sessions"]
    assert one.values["sessions"] == 2 and "jump of the idle" in one.values["by"]


def test_a_long_pause_of_the_stamps_tells_sittings_apart(make):
    logs = make(1, levels=(40.0, 80.0), repeats=2)
    after_s = {name: 1.73e9 + 60 * k + 7200 * (k > 1) for k, name in enumerate(logs)}
    stamped = {name: one.assign(time_s=one["time_s"] + after_s[name]) for name, one in logs.items()}
    (found,) = [one for one in eaid.read(stamped).findings if one.code == "several-sessions"]
    assert found.values["sessions"] == 2 and found.values["mixed"] and "dates" in found.values["by"]


def test_a_folder_is_followed_step_by_step_and_then_fitted(folder, run_eaid, make, tmp_path, monkeypatch):
    monkeypatch.setattr(follow, "LOOK_S", 0.1)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plan.csv").write_text("order,level,repeat,idle_s,hold_s,release_s\n1,60,1,5,66,5\n2,87,1,5,66,5\n")
    (tmp_path / "live").mkdir()
    (tmp_path / "live" / "notes.csv").write_text("what,when\nthe belt slipped,noon\n")  # no log: told, and left out

    def record():
        frames = {"a": (60.0, 0.1), "b": (60.0, 3.0)}
        for name, (level, gain) in frames.items():
            time.sleep(0.4)
            (frame,) = make(95, gain, levels=(level,), repeats=1).values()
            frame.round(6).to_csv(tmp_path / "live" / f"{name}.csv", index=False)

    recorder = threading.Thread(target=record)
    recorder.start()
    told = run_eaid(
        "fit", "live", "--follow", "1.5", "--against", folder / "rig.json", "--plan", "plan.csv", "-o", "fit.json"
    )
    recorder.join()
    lines = [line for line in told.err.splitlines() if line.startswith(("60 %", "next by plan"))]
    assert len(lines) == 4, told.err
    assert lines[0].startswith("60 %: T_s") and "(expected" in lines[0] and lines[0].endswith("ok")
    assert lines[1] == "next by plan: 87 %, 66 s"
    assert lines[2].endswith("outside: record again?")
    assert told.code in (0, 4) and (tmp_path / "fit.json").is_file() and "left out: notes.csv" in told.err


def test_a_folder_with_a_manifest_is_followed_as_that_says(run_eaid, make, tmp_path, monkeypatch):
    """Nine of ten good logs were left out as such that say no level."""
    monkeypatch.setattr(follow, "LOOK_S", 0.05)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "live").mkdir()
    (frame,) = make(95, 0.1, levels=(60.0,), repeats=1).values()
    frame.columns = ["Temps (s)", "Commande (%)", "Couple (N.m)"]
    frame.assign(Couple2=frame["Couple (N.m)"] / 2).to_csv(tmp_path / "live" / "a.csv", index=False)
    columns = 'input="Commande (%)",output="Couple (N.m)"'
    run_eaid("ingest", "live", "--columns", columns, "--write-manifest", "-o", "data.h5")
    told = run_eaid("fit", "live", "--follow", "0.4", "-o", "fit.json").err
    assert "60 %: T_s" in told and "record it again" not in told
    (tmp_path / "live" / "dataset.toml").write_text("no = = toml\n")
    told = run_eaid("fit", "live", "--follow", "0.4", "-o", "other.json")
    assert told.code == 3 and "dataset.toml: is no TOML" in told.err and "record it again" not in told.err


@pytest.mark.slow
def test_a_log_without_a_step_from_rest_gets_its_line_too(run_eaid, tmp_path, monkeypatch):
    monkeypatch.setattr(follow, "LOOK_S", 0.05)
    monkeypatch.chdir(tmp_path)
    held = np.repeat([20.0, 40.0, 60.0, 40.0, 20.0], 100)
    output = 0.05 * lfilter([0.1], [1, -0.9], held) + 0.01 * np.random.default_rng(1).standard_normal(500)
    (tmp_path / "live").mkdir()
    frame = pd.DataFrame({"time_s": 0.05 * np.arange(500), "duty_pct": held, "torque_nm": output})
    frame.to_csv(tmp_path / "live" / "stairs.csv", index=False)
    told = run_eaid("fit", "live", "--follow", "0.5", "--ci", "none", "--shape", "one", "-o", "fit.json").err
    assert "live/stairs.csv: 25 s, 20 … 60 %," in told and "the fit at the end takes it" in told


def read_while(record, folder, monkeypatch, *more):
    """Name and lines of each file that is whole, of a folder into which another thread writes meanwhile."""
    monkeypatch.setattr(follow, "LOOK_S", 0.05)
    recorder = threading.Thread(target=record)
    recorder.start()
    told = [(file.name, file.read_text().splitlines()) for file in follow.whole_files([folder], 1.2, *more)]
    recorder.join()
    return told


@pytest.mark.slow
def test_a_file_that_is_still_being_written_is_not_read(tmp_path, monkeypatch):
    """One that paused in the middle of a row was told as broken, and one that paused behind a row as a step."""

    def record():
        for k in range(12):  # a row every 3 looks, but for one pause of 6
            with (tmp_path / "a.csv").open("a") as file:
                file.write(f"{k},1\n")
            time.sleep(0.3 if k == 6 else 0.15)
        (tmp_path / "b.csv").write_text("0,1\n1,")
        time.sleep(0.3)
        (tmp_path / "b.csv").write_text("0,1\n1,1\n")

    told = read_while(record, tmp_path, monkeypatch)
    assert told[-1] == ("b.csv", ["0,1", "1,1"])  # on a machine that halts, each may come once more before
    assert [name for name, _ in told].count("a.csv") <= 3 and [name for name, _ in told].count("b.csv") <= 2


@pytest.mark.slow
def test_a_log_that_is_flushed_every_few_seconds_is_read_once_it_is_whole(tmp_path, monkeypatch):
    """Whole rows, then nothing for some seconds: half a step was told, and the next held against it."""

    def record():
        time.sleep(0.1)
        for k in range(4):
            with (tmp_path / "live.csv").open("a") as file:
                file.write(f"{k},1\n")
            time.sleep(0.3)

    told = read_while(record, tmp_path, monkeypatch, lambda file: len(file.read_text().splitlines()))
    assert [len(rows) for _, rows in told] == [4]
