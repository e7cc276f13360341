"""The table beside another library says what was measured."""

from bench.head_to_head import EPISODES, Row, library, table, with_rows_of


def test_a_row_has_medians_ratios_and_counts():
    row = Row("merge-v0", [4e-6, 5e-6, 6e-6], [20e-6, 10e-6, 24e-6], 4, 1, EPISODES, 0)
    heading, line, values = table([row], "Other", "1.0").splitlines()
    assert "Other 1.0" in heading
    assert set(line) <= set("|- ")
    cells = [cell.strip() for cell in values.strip("|").split("|")]
    # ratios of the turns: 5, 2, 4
    assert cells[:4] == ["`merge-v0`", "5.0 us", "20.0 us", "4.0 (2.0 to 5.0, n = 3)"]
    assert cells[4] == "engine 4, Other 1"
    # 10 of 10: from (0.05 / 2) ** (1 / 10) = 69 % on (Clopper and Pearson); none: up to 31 %
    assert cells[5] == "engine 10 of 10 (69 to 100 %); Other 0 of 10 (0 to 31 %)"


def test_rows_of_other_environments_stay():
    before = "| x |\n| --- |\n| `a` | old |\n| `b` | old |\n"
    assert with_rows_of(before, "| x |\n| --- |\n| `b` | new |") == "| x |\n| --- |\n| `b` | new |\n| `a` | old |"


def test_a_library_that_is_not_there_is_skipped_by_name(capsys):
    assert library("no_such_pool") is None
    assert "pip install 'rss-shield[no_such_pool]'" in capsys.readouterr().err
