"""Taking new fits: tables of the pages get new rows, and all around them stays."""

PAGE = """\
# Page

Text with a | in it.

| building | maps | left out | `walls` |
| --- | ---: | ---: | ---: |
| one | 2 | 80.0 | 70.5 |
| other/b | 1 | 81.0 | 60.0 |

| group (maps) | quarter turn |
| --- | ---: |
| survey_empty (2) | 1.0 |
| homes (2) | 2.0 |
"""


def test_only_the_rows_of_one_table_change():
    from fit_grouping.adopt_fits import with_rows

    page = with_rows(PAGE, "| building | maps", ["| new | 3 | 90.0 | 1.0 |"])
    old = "| one | 2 | 80.0 | 70.5 |\n| other/b | 1 | 81.0 | 60.0 |\n"
    assert page == PAGE.replace(old, "| new | 3 | 90.0 | 1.0 |\n")


def test_the_last_table_of_a_page_changes_likewise():
    from fit_grouping.adopt_fits import with_rows

    page = with_rows(PAGE, "| group (maps)", ["| homes (2) | 3.0 |"])
    assert page.endswith("| --- | ---: |\n| homes (2) | 3.0 |\n")
    assert with_rows(PAGE, "| group (maps)", PAGE.splitlines()[-2:]) == PAGE


def test_one_row_changes_by_how_it_begins():
    from fit_grouping.adopt_fits import with_row

    page = with_row(PAGE, "| other/b |", "| other/b | 1 | 99.0 | 60.0 |")
    assert page == PAGE.replace("81.0", "99.0")


def test_groups_get_the_names_that_people_read():
    from fit_grouping.adopt_fits import renamed

    rows = ["| survey_empty (2) | 1.0 |", "| homes (2) | 2.0 |", "| incremental_fr79 | 3.0 |"]
    assert renamed(rows) == [
        "| survey, empty (2) | 1.0 |",
        "| homes (2) | 2.0 |",
        "| exploration, Freiburg 079 | 3.0 |",
    ]


def test_the_pages_have_the_tables_that_are_written():
    """So that nobody finds out after an hour of fitting."""
    from fit_grouping.adopt_fits import LEFT_OUT, PROJECT

    accuracy = (PROJECT / "docs/accuracy.md").read_text("utf-8")
    card = (PROJECT / "docs/model_card.md").read_text("utf-8")
    readme = (PROJECT / "tools/fit_grouping/README.md").read_text("utf-8")
    for head in ("| group | maps | precision", f"| {LEFT_OUT} |", "| group (maps) | quarter turn"):
        assert f"\n{head}" in accuracy
    assert "\n| building | maps | left out" in card
    assert "\n| seed 0 |" in readme
