# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks write their tables into the pages of docs/; every benchmark has its section there."""

import argparse
import importlib
from pathlib import Path

import pytest

from kurumaisu.bench import __main__, page
from kurumaisu.bench.table import MarkdownTable, Table, collected
from kurumaisu.errors import Error

ROOT = Path(__file__).resolve().parent.parent
SECTIONS = [
    pytest.param(path, section, id=f"{path.name} {section.name}")
    for path in [ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
    for section in page.sections(path.read_text(encoding="utf-8"))
]
BEFORE = "# Page\n\n<!-- bench arena -->\nold\n<!-- end -->\n\nwords\n\n<!-- bench sim -->\nkept\n<!-- end -->\n"


def test_every_benchmark_has_one_section_in_the_docs():
    assert sorted(each.values[1].name for each in SECTIONS) == sorted(__main__.MODULES)


def test_the_page_of_benchmarks_is_short():
    assert len((ROOT / "docs/benchmarks.md").read_text(encoding="utf-8").splitlines()) <= 200


@pytest.mark.parametrize(("path", "section"), SECTIONS)
def test_the_command_of_a_section_parses(path, section, monkeypatch):
    """As far as the benchmark's own parser goes; placeholders of paths are words like any others."""

    class ParsedError(Exception):
        pass

    real = argparse.ArgumentParser.parse_args

    def parse(self, args=None, namespace=None):
        real(self, args, namespace)
        raise ParsedError

    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", parse)
    with pytest.raises(ParsedError):
        importlib.import_module(__main__.MODULES[section.name]).main(section.arguments)


@pytest.mark.parametrize(("path", "section"), SECTIONS)
def test_a_section_has_a_table_and_no_path_of_a_machine(path, section):
    text = path.read_text(encoding="utf-8").split(f"<!-- bench {section.name} -->\n")[1].split("<!-- end -->")[0]
    rows = [line for line in text.splitlines() if line.startswith("| ")]
    assert len(rows) >= 3
    assert not any(argument.startswith("/") for argument in section.arguments)


def test_a_table_in_markdown_has_its_numbers_on_the_right(capsys):
    table = Table("what it cost", "way   ", "CPU [ms]", "verdict  ", "interval")
    table.row("one | two", 1.23456, "kept", "0.91 (0.89-0.93)")
    table.row("three", "-", "BROKEN", "1.2e-09")
    table.note("The limit is 2 ms.")
    assert table.markdown() == (
        "what it cost:\n\n| way | CPU [ms] | verdict | interval |\n| --- | ---: | --- | ---: |\n"
        "| one / two | 1.235 | kept | 0.91 (0.89-0.93) |\n| three | - | BROKEN | 1.2e-09 |\n\nThe limit is 2 ms."
    )
    assert capsys.readouterr().out.endswith("The limit is 2 ms.\n")


def test_a_table_of_long_texts_is_printed_as_it_stands_in_a_page(capsys):
    table = MarkdownTable("", "fault", "seen")
    table.row("a", "b")
    assert capsys.readouterr().out == table.markdown() + "\n" == "| fault | seen |\n| --- | --- |\n| a | b |\n"


def written(tmp_path, monkeypatch, arguments, text=BEFORE):
    """Return what a page is after a benchmark that prints a table and a detail, and its exit status."""

    def run(_arguments):
        Table("detail", "a", "b", page=False).row("x", 1.0)
        Table("", "robots", "scan [ms]").row("one", 2.5)
        return 1

    monkeypatch.setattr(importlib.import_module(__main__.MODULES["arena"]), "main", run)
    monkeypatch.setattr("os.cpu_count", lambda: 3)
    path = tmp_path / "page.md"
    path.write_text(text)
    return __main__.main(["arena", *arguments, "--write", str(path)]), path.read_text()


def test_only_its_own_section_is_written(tmp_path, monkeypatch):
    status, text = written(tmp_path, monkeypatch, ["--threads", "2", "--map", "/here/cave.png", "/there", "--log=/a/b"])
    assert status == 1  # as the benchmark says: a broken bound is to be read in the page, too
    table = "| robots | scan [ms] |\n| --- | ---: |\n| one | 2.5 |"
    command = "    scripts/bench arena --threads 2 --map MAP FOLDER --log=LOG    # on 3 cores"
    assert text == BEFORE.replace("old", f"{command}\n\n{table}")
    assert [each.name for each in tmp_path.iterdir()] == ["page.md"]
    assert page.sections(text.replace("kept", "scripts/bench sim"))[0].arguments[:2] == ["--threads", "2"]


@pytest.mark.parametrize("text", ["# Page\n", BEFORE + BEFORE, "<!-- bench arena -->\nno end\n"])
def test_a_page_without_its_section_is_left_alone(tmp_path, monkeypatch, capsys, text):
    status, after = written(tmp_path, monkeypatch, [], text)
    assert status != 0
    assert after == text
    assert "sections from `<!-- bench arena -->` to `<!-- end -->`, not one" in capsys.readouterr().err


def test_a_page_that_is_not_there_is_said_before_hours_of_work(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(
        importlib.import_module(__main__.MODULES["arena"]), "main", lambda _: pytest.fail("it ran nonetheless")
    )
    assert __main__.main(["arena", f"--write={tmp_path}/none.md"]) != 0
    assert "none.md: No such file" in capsys.readouterr().err
    assert __main__.main(["arena", "--write"]) != 0


def test_details_are_written_where_there_is_nothing_else(tmp_path):
    path = tmp_path / "page.md"
    path.write_text(BEFORE)
    with collected() as tables:
        Table("detail", "a", "b", page=False).row("x", 1.0)
    page.write(path, "bench", "arena", [], tables)
    assert "| x | 1 |" in path.read_text()
    with pytest.raises(Error, match="made no table"):
        page.write(path, "bench", "arena", [], [])


def test_a_section_without_its_command_is_refused():
    with pytest.raises(Error, match="is not its command"):
        page.sections("<!-- bench sim -->\n    scripts/bench pool\n<!-- end -->\n")
