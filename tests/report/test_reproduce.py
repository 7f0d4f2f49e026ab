"""The paper, number by number: docs/paper.md is what the command computes."""

import re
from pathlib import Path

import pytest

from eaid.cli.main import run
from eaid.report.paper.claims import BEGIN, END, VERDICTS, Claim, markdown

DOCS = Path(__file__).parents[2] / "docs/paper.md"
NUMBER = re.compile(r"(?<![\w.])[−+-]?\d+(?:\.\d+)?(?:e[−+-]?\d+)?")
WITHIN = 0.03
"""Another processor may round a fit's last digits otherwise; the table shows two or three."""


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("paper") / "table.md"
    assert run(["reproduce", "-o", str(path), "-q"]) == 0
    return path.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def rows(table: str) -> dict[tuple[str, str], list[str]]:
    cells = [
        [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in table.splitlines() if line[:1] == "|"
    ]
    return {(row[0], row[1]): row for row in cells[2:]}


def numbers(text: str) -> list[float]:
    return [float(found.replace("−", "-")) for found in NUMBER.findall(text)]


def words(text: str) -> str:
    return re.sub(r"\s+", " ", NUMBER.sub("#", text))


def near(a: float, b: float) -> bool:
    """Equal within WITHIN; whole numbers may be one apart, as a rounded percentage is."""
    whole = a.is_integer() and b.is_integer() and abs(a) < 200
    return abs(a - b) <= max(WITHIN * max(abs(a), abs(b)), 1e-9, whole)


def same(one: str, other: str) -> bool:
    """Whether two lines agree in their words, and nearly in their numbers."""
    if words(one) != words(other):
        return False
    return all(near(a, b) for a, b in zip(numbers(one), numbers(other), strict=True))


def test_the_comparison_can_fail():
    assert same("RC 0.116 N·m, 85 %", "RC 0.117 N·m, 85 %")
    assert not same("RC 0.116 N·m", "RC 0.126 N·m")
    assert not same("holds 1", "does not hold 1")


def test_docs_and_command_are_equal(table: str):
    text = DOCS.read_text(encoding="utf-8")
    kept = text.split(BEGIN)[1].split(END)[0].strip().splitlines()
    fresh = table.strip().splitlines()
    different = [(a, b) for a, b in zip(kept, fresh, strict=False) if not same(a, b)]
    assert len(kept) == len(fresh) and not different, (
        f"docs/paper.md is out of date; put the output of `eaid reproduce` between its marks: {different[:2]}"
    )


def test_every_table_entry_of_the_paper_is_there(rows: dict[tuple[str, str], list[str]]):
    entries = {
        table: sum(1 for where, _ in rows if where == table)
        for table in ("Table I", "Table II", "Table III", "Table IV")
    }
    # 14 coefficients and 4 RMSE; 12 and 3; 11 (and the value they give); 8, two pairs of them in one line
    assert entries == {"Table I": 18, "Table II": 15, "Table III": 12, "Table IV": 6}
    for figure in (2, 3, 4, 5, 6, 7, 8, 9, 11, 12, 13, 16, 17):
        assert any(re.search(rf"Fig\. {figure}\b", where) for where, _ in rows), figure


def test_verdicts_are_the_four_and_failures_say_why(rows: dict[tuple[str, str], list[str]]):
    for row in rows.values():
        verdict, _, why = row[3].partition(": ")
        assert verdict in VERDICTS
        assert why or verdict in VERDICTS[:2]
        assert re.match(r"`eaid \w", row[4])
    with pytest.raises(AssertionError):
        Claim("§", "printed", "ours", "eaid", VERDICTS[-1])


@pytest.mark.parametrize(
    ("where", "printed", "ours", "verdict"),
    [
        (
            "Eq. (8)",
            "a0, b0, c0 = 1.36, 0.08, −2.42",
            "1.84, 0.0783, −1.34 (10…100 %, 20 s); 1.55, 0.0814, −2.11",
            "holds on",
        ),
        ("Table IV", "B_M = 42.6", "41.1 (10…100 %, 20 s), 45.9", "holds on"),
        ("§V-B", "PI of 21 and 360: 1 % overshoot, 0.27 s", "41.7 % and 2.52 s", "does not hold"),
        ("Fig. 12(b)", "RC error limited to 0.2 N·m", "0.116 N·m", "holds on"),
        ("Fig. 12(b)", "PI error 1.2 N·m", "0.797 N·m", "holds on"),
        ("Fig. 12(b)", "RC error 83 % less than the PI's", "85 % less", "holds on"),
        ("Fig. 13(a)", "the PI overshoots close to 0.6 Hz", "+2.1 dB at 0.6 Hz", "holds on"),
        ("Table III", "T_s at full duty, by its polynomial", "0.057 N·m", "does not hold"),
        ("Tables I and II", "both describe 86 N at 15 RPM", "τ1 0.232 s by Table I, 0.0438 s", "does not hold"),
        (
            "§IV-B",
            "accurate when the duty is close to 40 or 90",
            "51, 90 %, the refitted one at 29, 75 %",
            "does not hold",
        ),
        ("Eq. (15)", "ρ ≥ (α Q_M + α ‖K‖ ‖ξ‖ + B_M φ)/(1 − α)", "ρ = 10.8125 + 6.58595 ‖ξ‖", "holds"),
        ("Fig. 17", "normality validated, p < 0.001", "p < 0.001 in all three modes", "does not hold"),
    ],
)
def test_known_answers(rows: dict[tuple[str, str], list[str]], where: str, printed: str, ours: str, verdict: str):
    """Computed independently of this program, by its specification."""
    row = rows[where, printed]
    assert ours in row[2]
    assert row[3].startswith(verdict)


def test_bars_inside_a_cell_do_not_break_the_table():
    line = markdown([Claim("§", "|e|", "a\nb", "eaid", VERDICTS[0])]).splitlines()[-1]
    assert line == "| § | \\|e\\| | a b | holds | `eaid` |"


def test_what_data_were_made_of_is_counted_apart_and_absence_of_evidence_refutes_nothing(
    rows: dict[tuple[str, str], list[str]],
):
    verdicts = {key: row[3].partition(": ")[0] for key, row in rows.items()}
    for table, terms in (
        ("Table I", ("T_s, slope", "τ2, q")),
        ("Table II", ("T_s, p", "T_s, r")),
        ("Table III", ("b_1",)),
    ):
        for term in terms:
            assert [v for (where, said), v in verdicts.items() if where == table and said.startswith(term)] == [
                "circular"
            ]
    gone = next(row for (where, said), row in rows.items() if where == "Table II" and said.startswith("T_s, r"))
    assert "does NOT come back" in gone[3]
    differ = {said: row for (where, said), row in rows.items() if where == "Fig. 17" and "differ" in said}
    assert len(differ) == 3
    for row in differ.values():
        assert row[3].startswith(("holds on", "not decided"))
        assert "by 10" in row[2]
