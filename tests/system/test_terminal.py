"""What commands print, beside the numbers themselves."""

import json
import math
import re
import sys

import pytest

from granforce.system.terminal import Bar, one_line, print_list, print_report

pytestmark = pytest.mark.fast


@pytest.fixture(autouse=True)
def of_terminal(capsys, monkeypatch):
    monkeypatch.setattr(type(sys.stderr), "isatty", lambda self: True)


def shown(capsys):
    """The states of a bar that were seen, one after the other."""
    return [state.strip() for state in re.split(r"[\r\n]", capsys.readouterr().err) if state]


def test_a_bar_that_is_not_used_is_not_seen(capsys):
    with Bar("cells", "cell"):
        pass
    assert shown(capsys) == []


def test_a_file_gets_a_line_of_progress_each_minute(capsys, monkeypatch):
    monkeypatch.setattr(type(sys.stderr), "isatty", lambda self: False)
    with Bar("cells", "cell") as progress:
        progress(1, 3)
        progress.bar.start_t -= 90.0
        progress.bar.last_print_t -= 90.0
        progress(2, 3)
    first, *others = shown(capsys)
    assert re.fullmatch(r"cells: 2/3 cell \[01:30<00:45\]", first) and len(others) <= 1


def test_short_work_is_not_seen_in_a_file(capsys, monkeypatch):
    monkeypatch.setattr(type(sys.stderr), "isatty", lambda self: False)
    with Bar("cells", "cell") as progress:
        progress.note("η1 = 0.2104")
        progress(1, 2)
        Bar.restart()
        progress(2, 2)
    assert shown(capsys) == [] and Bar.line_end() == ""


def test_rates_count_from_the_beginning(capsys):
    """A hundred steps are told at once, two seconds after the work began."""
    with Bar("compaction", "step") as progress:
        progress.bar.start_t -= 2.0
        progress.bar.last_print_t -= 2.0
        progress.note("φ = 0.5")
        progress(100, None)
    last = shown(capsys)[-1]
    told = re.fullmatch(r"compaction: 100 step \[00:02, +([\d.]+) step/s, φ = 0\.5\]", last)
    assert told and 30 < float(told[1]) <= 50.1


def test_compiling_does_not_count_in_rates():
    with Bar("bounds", "bound") as progress:
        progress(0, 10)
        progress.bar.start_t -= 60
        Bar.restart()
        progress(1, 10)
        assert progress.bar.format_dict["initial"] == 1
        assert progress.bar.format_dict["elapsed"] < 30


def test_a_bar_knows_its_end(capsys):
    with Bar("cells", "cell") as progress:
        progress(0.25, 2)
        progress(2, 2)
    assert "2/2" in shown(capsys)[-1]


def test_a_note_stands_behind_the_bar(capsys):
    with Bar("random walk", "state") as progress:
        progress.note("η1 = 0.2104")
        progress(2, 2)
    assert shown(capsys)[-1].endswith("η1 = 0.2104]")


def test_a_warning_is_one_line():
    told = one_line(UserWarning("two\nlines"), UserWarning, "file.py", 3)
    assert told == "granforce: two lines\n"


def strict(text):
    """What JSON means by a text; a ValueError where it means nothing."""

    def refuse(word):
        raise ValueError(f"{word} is no JSON")

    return json.loads(text, parse_constant=refuse)


def test_what_is_not_a_number_is_null_in_json(capsys):
    print_report(
        {"eta": math.nan, "deciles": [1.0, math.inf], "fit": (-math.inf, {"x": math.nan})}, True
    )
    told = strict(capsys.readouterr().out)
    assert told == {"eta": None, "deciles": [1.0, None], "fit": [None, {"x": None}]}
    print_list([{"gap": math.nan}], ("gap",), True)
    assert strict(capsys.readouterr().out) == [{"gap": None}]


def test_sentences_stand_line_by_line(capsys):
    print_report({"left_open": [1, 2], "findings": ["2 grains: a, b", "3 contacts: c"]}, False)
    assert capsys.readouterr().out.splitlines() == [
        "left open  1 2",
        "findings   2 grains: a, b",
        "           3 contacts: c",
    ]
