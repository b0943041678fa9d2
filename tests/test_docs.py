# SPDX-License-Identifier: BSD-3-Clause
"""README and docs: commands and snippets run as they stand, links lead somewhere, the index leads to every page."""

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from docs_pages import NOT_RUN, PAGES, READ_ONLY, ROOT, SCENES, blocks, commands, filled_in
from docs_rig import PATIENCE, Reader

COMMANDS = commands()
SNIPPETS = [(page, line, text) for page in PAGES for line, text in blocks(page, "python")]
# Reads the arguments of each command as its own parser does, and runs nothing.
READ_ARGUMENTS = """
import argparse, contextlib, io, json, runpy, sys

class Read(BaseException):
    pass

def parse(self, args=None, namespace=None, parse=argparse.ArgumentParser.parse_args):
    parse(self, args, namespace)
    raise Read

argparse.ArgumentParser.parse_args = parse
for kind, name, *arguments in json.load(sys.stdin):
    sys.argv = [name, *arguments]
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
            (runpy.run_module if kind == "module" else runpy.run_path)(name, run_name="__main__")
        problem = f"took no arguments: {said.getvalue()}"
    except Read:
        problem = ""
    except SystemExit as end:
        problem = f"exit code {end.code}: {said.getvalue()}"
    print(json.dumps(problem), flush=True)
"""


@pytest.fixture(scope="module")
def reader(tmp_path_factory):
    folder = tmp_path_factory.mktemp("docs")
    one = Reader(folder, COMMANDS)
    for name in ("day_1", "day_2"):
        (folder / name).mkdir()
        (folder / name / "meta.yaml").write_text("truth: {position_sd: 0.005, heading_sd: 0.005}\n")
        rows = [f"{t / 10},0,0,{0.001 * (t % 3)}" for t in range(100)]
        (folder / name / "pose.csv").write_text("\n".join(["t,x,y,theta", *rows, ""]))
        (folder / name / "command.csv").write_text("t,v,w\n0,0,0\n")
    yield one
    one.close()


@pytest.fixture(scope="module")
def read():
    """What is wrong with the arguments of the commands that are only read, by their text."""
    texts = sorted({command.text for command in COMMANDS if re.search(READ_ONLY, command.text)})
    programs = []
    for text in texts:
        if bench := re.match(r"scripts/bench (.*)", text):
            programs.append(["module", "kurumaisu.bench", *shlex.split(bench[1])])
        elif module := re.match(r"scripts/run python3? -m (.*)", text):
            programs.append(["module", *shlex.split(module[1])])
        else:
            name, *arguments = shlex.split(re.sub(r"^scripts/run rosrun kurumaisu ", "", text))
            programs.append(["path", str(ROOT / "scripts" / name), *arguments])
    done = subprocess.run(
        [sys.executable, "-c", READ_ARGUMENTS],
        input=json.dumps(programs),
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=True,
    )
    return dict(zip(texts, map(json.loads, done.stdout.splitlines()), strict=True))


@pytest.mark.parametrize("command", COMMANDS, ids=str)
def test_a_command_does_what_its_page_says(command, request):
    if any(re.search(pattern, command.text) for pattern in NOT_RUN):
        return
    if re.search(READ_ONLY, command.text):
        assert not request.getfixturevalue("read")[command.text]
        return
    try:
        problem = request.getfixturevalue("reader").outcome(command)
    except KeyError:
        pytest.fail(f"{command.text}\nsay in docs_pages.py how this is run, or why it cannot be")
    if problem:
        pytest.fail(f"{command.text}\n{problem}")


@pytest.mark.parametrize(("page", "line", "text"), SNIPPETS, ids=[f"{p.name}:{line}" for p, line, _ in SNIPPETS])
def test_a_snippet_runs(page, line, text, reader):
    if "RECORDING" in text:
        reader.outcome(next(c for c in COMMANDS if "record.launch bag:=$PWD/drive.bag" in c.text))  # which makes it
    snippet = reader.folder / f"out/{page.stem}_{line}.py"
    snippet.write_text(filled_in(text, reader.folder))
    running = reader.start(f"{sys.executable} {snippet}")
    assert running.finish() == 0, running.output


def anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as GitHub and GitLab make them."""
    text = re.sub(r"^\s*```.*?^\s*```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    heads = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


def links(page: Path) -> list[tuple[str, Path, str]]:
    """Return what a page links to within the tree: as it says, file, anchor."""
    found = []
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if not target.startswith(("http:", "https:")):
            name, _, anchor = target.partition("#")
            found.append((target, (page.parent / name).resolve() if name else page, anchor))
    return found


@pytest.mark.parametrize("page", [*PAGES, ROOT / "CONTRIBUTING.md"], ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_leads_somewhere(page):
    for target, path, anchor in links(page):
        assert path.exists(), target
        assert not anchor or anchor in anchors(path), target


def test_the_index_leads_to_every_page():
    reached, todo = set(), [ROOT / "docs/index.md"]
    while todo:
        page = todo.pop()
        if page not in reached:
            reached.add(page)
            todo += [path for _, path, _ in links(page) if path.suffix == ".md" and ROOT / "docs" in path.parents]
    assert {page for page in PAGES if ROOT / "docs" in page.parents} == reached


def test_readme_is_short_and_shows_the_page_a_report_and_a_map():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 150
    pictures = re.findall(r"!\[[^]]*\]\(([^)]+)\)", text)
    assert len(pictures) == 3
    assert all((ROOT / picture).stat().st_size < 200_000 for picture in pictures)


def test_no_table_of_the_test_names_what_is_gone():
    for pattern in (*NOT_RUN, READ_ONLY, *(part.pattern for scene in SCENES for part in scene)):
        assert any(re.search(pattern, command.text) for command in COMMANDS), pattern
