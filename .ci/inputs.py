# SPDX-License-Identifier: BSD-3-Clause
"""What each check depends on: a check that passed is not run again before any of it changes.

In doubt more than less: a module depends on whatever its imports reach, at the top or in a function, and on each module
whose name it has in a string; a test that starts processes or lists folders depends on the whole tree.
"""

from __future__ import annotations

import re
import subprocess
from functools import cache, cached_property
from pathlib import Path

import sources
from sources import ROOT

DEVEL = ROOT / ".ws/devel"
TESTS = ROOT / "tests"
ROOTS = (ROOT / "src", TESTS, ROOT / ".ci")  # where modules are found
_FROM = re.compile(r"^[ \t]*from[ \t]+([\w.]+)[ \t]+import[ \t]+(\([^)]*\)|[^\n#]+)", re.MULTILINE)
_IMPORT = re.compile(r"^[ \t]*import[ \t]+([\w., \t]+)", re.MULTILINE)
_DOTTED = re.compile(r"\bkurumaisu(?:\.\w+)+")
_ANY_MODULE = re.compile(r"import_module|__import__|iter_modules|walk_packages")
_WHOLE_TREE = re.compile(
    r"subprocess|multiprocessing|Popen|\.processes\b|glob\(|iterdir|listdir|os\.walk|ls-files|\.cpp\b"
)
_PAGES = re.compile(r"docs|README|CONTRIBUTING|CHANGELOG|\.md\b|\.rst\b|ls-files")
# Waits for what others do, rather than for its own sums: gets the cores first, and is what a busy machine disturbs.
_WAITS = re.compile(
    r"^\s*(?:import|from) (?:asyncio|kurumaisu[\w.]*\.processes|playwright|rospy|socket|subprocess|threading|time)\b",
    re.MULTILINE,
)


class Inputs:
    """The tree as it is now."""

    def __init__(self) -> None:
        """List the files that git tracks or would track, and hash what is installed."""
        self.files = sources.files()
        packages = subprocess.run(["dpkg-query", "-W"], check=True, capture_output=True, text=True).stdout
        stamps = [path.read_text() for path in (ROOT / ".venv/stamp", ROOT / ".ws/stamp") if path.exists()]
        self._installed = (packages, *stamps)

    def under(self, *folders: str) -> set[Path]:
        """Return the files in these folders."""
        return {path for path in self.files if path.relative_to(ROOT).parts[0] in folders}

    @cached_property
    def tree(self) -> set[Path]:
        """All files but pages."""
        return {path for path in self.files if path.suffix not in (".md", ".rst", ".png", ".svg")}

    @cached_property
    def native(self) -> set[Path]:
        """All files that a compiler or what configures it reads."""
        suffixes = {".cpp", ".h", ".txt", ".cfg", ".msg", ".srv", ".xml"}
        return {path for path in self.tree if path.suffix in suffixes or path.name == ".clang-tidy"}

    @cached_property
    def data(self) -> set[Path]:
        """Files that any test may read: all in src, launch and so on that is no source, and the tests' own."""
        folders = self.under("src", "launch", "worlds", "msg", "scripts", "tests")
        return {path for path in folders if path.suffix not in (".py", ".cpp", ".h")} | self._top

    @cached_property
    def _top(self) -> set[Path]:
        return {path for path in self.files if path.parent == ROOT and path in self.tree}

    def state(self, paths: set[Path], *more: str) -> str:
        """Return a hash of files, of what is installed, and of more."""
        return sources.content_hash(paths, *self._installed, *more)

    @cached_property
    def built(self) -> str:
        """Hash of all programs and libraries but those that the checks themselves build."""
        made = (path for path in DEVEL.rglob("*") if path.suffix in ("", ".so") and not path.is_symlink())
        return sources.content_hash(p for p in made if p.is_file() and not p.name.startswith(("test_", "fuzz_")))

    @cached_property
    def recordings(self) -> str:
        """Names, sizes and times of the measured data beside the tree, if they are there."""
        found = sorted(path for path in (ROOT.parent / "shared").rglob("*") if path.is_file())
        return "".join(f"{path} {path.stat().st_size} {path.stat().st_mtime_ns}\n" for path in found)

    def of_pytest(self, test: Path) -> str:
        """Return the state of what a file of pytest depends on."""
        reached = _with_fixtures(test)
        own = "\n".join(_text(path) for path in reached if _is_rig(path))
        if _WHOLE_TREE.search(own):
            reached |= self.tree
        if _PAGES.search(own):
            reached |= set(self.files)
        if _WHOLE_TREE.search(own):
            return self.state(reached | self.data, self.built, self.recordings)
        modules = [
            path
            for name in ("_core", "_slam")
            if any(name in _text(path) for path in reached if path.suffix == ".py")
            for path in DEVEL.rglob(f"{name}.*.so")
        ]
        return self.state(reached | self.data | with_libraries(*modules), self.recordings)

    def of_rostest(self, test: Path) -> str:
        """Return the state of what a rostest depends on: the whole package, of the tests its own."""
        names = re.findall(r"\b(\w+\.py)\b", test.read_text())
        own = closure(*(TESTS / name for name in names if (TESTS / name).exists()))
        rest = {path for path in self.tree if path.is_relative_to(TESTS) and path.suffix in (".py", ".cpp", ".h")}
        return self.state(self.tree - rest - self.under(".ci") | own, self.built, self.recordings)

    def of_program(self, program: Path) -> str:
        """Return the state of what a program of gtest depends on."""
        return self.state(self.data | with_libraries(program), self.built, self.recordings)


def with_libraries(*programs: Path) -> set[Path]:
    """Return programs or libraries, and the libraries of this tree that they are linked with."""
    there = {path for path in programs if path.exists()}
    listed = (
        subprocess.run(["ldd", *map(str, there)], check=False, capture_output=True, text=True).stdout if there else ""
    )
    return there | {Path(name) for name in re.findall(r"=> (\S+)", listed) if Path(name).is_relative_to(DEVEL)}


def waits(test: Path) -> bool:
    """Tell whether a test, or a rig that it imports, waits for processes, threads or the clock."""
    return any(_WAITS.search(_text(path)) for path in closure(test) if _is_rig(path))


def _with_fixtures(test: Path) -> set[Path]:
    """Return what a test reaches; with what the fixtures for all tests reach, if it asks for one."""
    shared = TESTS / "conftest.py"
    names = "|".join(re.findall(r"@pytest\.fixture.*\ndef (\w+)", _text(shared)))
    asked = re.search(rf"^ *(?:async )?def \w+\([^)]*\b({names})\b", _text(test), re.MULTILINE)
    return closure(test, shared) if asked else closure(test) | {shared}


def _is_rig(path: Path) -> bool:
    """Tell whether a module is there for tests and benchmarks only."""
    return path.is_relative_to(TESTS) or path.is_relative_to(ROOT / "src/kurumaisu/bench")


def closure(*paths: Path) -> set[Path]:
    """Return these modules and all of this tree that they may import."""
    reached, todo = set[Path](), list(paths)
    while todo:
        path = todo.pop()
        if path not in reached:
            reached.add(path)
            todo += _imported(path)
    return reached


@cache
def _text(path: Path) -> str:
    return path.read_text()


@cache
def _imported(path: Path) -> frozenset[Path]:
    text = _text(path)
    names = set(_DOTTED.findall(text))
    names.update([f"{name}.__main__" for name in names] if '"-m"' in text else [])  # a package that it runs
    for base, some in _FROM.findall(text):
        stem = base if base.endswith(".") else f"{base}."
        names.update([base, *(stem + name for name in re.findall(r"\w+", some))])
    for several in _IMPORT.findall(text):
        names.update(part.split()[0] for part in several.split(",") if part.strip())
    found = {file for name in names for file in _files(_absolute(name, path))}
    if _ANY_MODULE.search(text):
        found.update(path.parent.rglob("*.py"))
    return frozenset(found)


def _absolute(name: str, path: Path) -> str:
    """Return a name that may be relative to a module's own package."""
    dots = len(name) - len(name.lstrip("."))
    if not dots:
        return name
    folder = path.parents[dots - 1].relative_to(ROOT / "src")
    return ".".join([*folder.parts, *([name[dots:]] if name[dots:] else [])])


@cache
def _files(name: str) -> frozenset[Path]:
    """Return the file of a module of this tree and those of its packages; a longer name counts by its beginning."""
    found, parts = set[Path](), name.split(".")
    for root in ROOTS:
        for i in range(1, len(parts) + 1):
            place = root.joinpath(*parts[:i])
            found.update(p for p in (place / "__init__.py", place.with_suffix(".py")) if p.is_file())
    return frozenset(found)
