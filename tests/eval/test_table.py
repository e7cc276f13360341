"""The table in all its forms."""

import io
from math import nan

import pandas as pd
import pytest
from result_tables import episodes_of
from rich.console import Console

from rss_shield.eval.metrics import summarise
from rss_shield.eval.table import print_table, rounded, table_frame, with_intervals, write_table


@pytest.fixture(scope="module")
def summary() -> pd.DataFrame:
    cells = [("off", "off", "ego"), ("off", "on", ""), ("on", "off", "inherited"), ("on", "on", "")]
    return summarise(pd.concat([episodes_of([blame] * 20, train, test) for train, test, blame in cells]))


def printed(summary: pd.DataFrame, width: int) -> str:
    stream = io.StringIO()
    print_table(summary, "A title", Console(file=stream, width=width))
    return stream.getvalue()


@pytest.mark.parametrize(
    ("numbers", "text"),
    [
        ((35.04, 26.4, 45.6, 12.0, 58.3, 0), "35 [26, 46] (12, 58)"),
        ((1.25, -1.0, 3.04, nan, nan, 1), "1.2 [-1.0, 3.0] (–)"),
        ((2.0, nan, nan, nan, nan, 1), "2.0 [–] (–)"),
        ((nan, 0.0, 100.0, nan, nan, 0), "–"),
    ],
)
def test_a_value_is_shown_with_its_intervals(numbers, text):
    *numbers, digits = numbers
    assert with_intervals(numbers, digits) == text


@pytest.mark.parametrize(
    ("number", "digits", "text"),
    [
        (0.0, 0, "0"),
        (0.19, 0, "0.2"),
        (0.5, 0, "0.5"),
        (0.051, 0, "0.05"),
        (0.004, 0, "0.004"),
        (99.81, 0, "99.8"),
        (99.5, 0, "99.5"),
        (99.4, 0, "99.4"),
        (98.9, 0, "99"),
        (99.9962, 0, "99.996"),
        (100.0, 0, "100"),
        (-0.04, 1, "-0.04"),
        (0.0, 1, "0.0"),
        (-1e-17, 1, "0.0"),
        (100 * (1 - 1e-16), 0, "100"),
        (12.34, 1, "12.3"),
        (1.4, 0, "1"),
        (98.6, 0, "99"),
    ],
)
def test_nothing_is_rounded_to_a_limit_that_it_is_not(number, digits, text):
    assert rounded(number, digits, (0.0, 100.0)) == text


@pytest.mark.slow
@pytest.mark.parametrize(
    ("crashes", "n", "text"),
    # z^2 = 3.84: 3.84 / 2003.84 = 0.19 %; 3.84 / 9003.84 = 0.043 %; 1 of 2000: [0.0088, 0.28] %
    [
        (0, 2000, "0 [0, 0.2] (–)"),
        (2000, 2000, "100 [99.8, 100] (–)"),
        (0, 9000, "0 [0, 0.04] (–)"),
        (1, 2000, "0.05 [0.009, 0.3] (–)"),
        (0, 60, "0 [0, 6] (–)"),
    ],
)
def test_no_crash_in_many_episodes_is_not_never_in_any_form_of_the_table(crashes, n, text, tmp_path):
    summary = summarise(episodes_of(["ego"] * crashes + [""] * (n - crashes)))
    assert table_frame(summary)["crash [%]"].tolist() == [text]
    write_table(summary, tmp_path, "A title")
    assert f"| {text} |" in (tmp_path / "table.md").read_text()
    assert f"& {text.replace('–', '--')} &" in (tmp_path / "table.tex").read_text()
    for part in text.split(" ", 1):
        assert part.split("] ")[0] in (tmp_path / "table.txt").read_text()


def test_two_seeds_have_an_interval_of_their_own_and_the_legend_says_which_is_which(tmp_path):
    summary = summarise(pd.concat([episodes_of(["ego"] * 9 + [""] * 11), episodes_of([""] * 20).assign(train_seed=1)]))
    write_table(summary, tmp_path, "A [x] title")
    text = (tmp_path / "table.md").read_text()
    # 9 of 40 with Wilson; 0 % and 45 % with Student: wider than all rates
    assert "| 22 [12, 38] (0, 100) |" in text
    assert "[low, high]: 95 % interval over test episodes of these trained models" in text
    assert "(low, high): the same over training seeds" in text
    assert (tmp_path / "table.txt").read_text().startswith("A [x] title")


def test_there_is_one_row_per_cell_and_one_column_per_metric(summary):
    frame = table_frame(summary)
    assert frame[["train", "test", "n"]].to_numpy().tolist() == [
        ["off", "off", "20"],
        ["off", "on", "20"],
        ["on", "off", "20"],
        ["on", "on", "20"],
    ]
    # all 20 crash: 20 / (20 + 3.84) = 84 %; none of 20: 3.84 / 23.84 = 16 %
    assert frame["crash [%]"].tolist() == ["100 [84, 100] (–)", "0 [0, 16] (–)"] * 2
    assert frame["ego at fault [%]"].tolist() == ["100 [84, 100] (–)"] + ["0 [0, 16] (–)"] * 3
    assert frame["speed [m/s]"].iloc[0] == "25.0 [25.0, 25.0] (–)"


def test_success_and_the_time_to_the_goal_are_columns_where_there_is_a_goal(summary, tmp_path):
    crossed = episodes_of([""] * 20).assign(time=7.0, success=True)
    stuck = episodes_of([""] * 20, test="on").assign(time=13.0, success=False)
    goal = summarise(pd.concat([crossed, stuck]))
    frame = table_frame(goal)
    assert frame["success [%]"].tolist() == ["100 [84, 100] (–)", "0 [0, 16] (–)"]
    assert frame["time to goal [s]"].tolist() == ["7.0 [7.0, 7.0] (–)", "–"]
    assert frame["n"].tolist() == ["20", "20"]
    write_table(goal, tmp_path, "A title")
    assert "time to goal: mean of those episodes" in (tmp_path / "table.md").read_text()
    assert "time to goal" not in printed(summary, 160)
    assert all("…" not in printed(goal, width) for width in range(80, 180, 4))


def test_a_wide_terminal_gets_the_cells_as_rows_with_nothing_cut_off(summary):
    text = printed(summary, 160)
    assert "…" not in text
    assert text.count("[84, 100]") == 4  # crash and at fault in one cell, crash and inherited in another
    assert "A title" in text
    assert "[low, high]: 95 % interval" in " ".join(text.split())


def test_a_narrow_terminal_gets_the_cells_as_columns_with_nothing_cut_off(summary):
    text = printed(summary, 80)
    assert "…" not in text
    assert text.count("[84, 100]") == 4  # crash and at fault in one cell, crash and inherited in another
    assert max(map(len, text.splitlines())) <= 80


def test_every_form_of_the_table_is_written(summary, tmp_path):
    write_table(summary, tmp_path, "A title")
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["table.csv", "table.md", "table.tex", "table.txt"]
    rows = [line for line in (tmp_path / "table.md").read_text().splitlines() if line.startswith("|")]
    assert len(rows) == 2 + 4
    assert len({row.count("|") for row in rows}) == 1
    latex = (tmp_path / "table.tex").read_text()
    assert latex.count(r"\\") == 5
    assert r"crash [\%]" in latex
    numbers = pd.read_csv(tmp_path / "table.csv")
    pd.testing.assert_frame_equal(numbers, summary)
