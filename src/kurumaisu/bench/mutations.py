# SPDX-License-Identifier: BSD-3-Clause
"""Small mistakes at random places of src/: how many of them the checks catch, and which check does.

One at a time, in a copy of the tree that is built in a folder of its own. Lint and types come first, then the tests
that are nearest to the changed file, until one fails. Each that fails runs again without the mistake: it counts only if
it passes there. Places are drawn by what their lines look like without names, so that files may move between two runs.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import hashlib
import os
import re
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from kurumaisu import children
from kurumaisu.bench.table import Table
from kurumaisu.errors import Error
from kurumaisu.whole_files import write_whole

_AWAY = re.compile(r"src/kurumaisu/(bench|demo)/")  # what measures or shows
_AGAIN, _BUILD = 300.0, 7200.0  # [s] for a check without a mutation; for a build of all
_NEIGHBOURS = 3  # lines before and after that tell a place from others
_BOUNDS = {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "=="}
_CODE: dict[str, tuple[re.Pattern[str], Callable[[str], str]]] = {  # by kind: what is changed in a line, and into what
    "sign": (re.compile(r"(?<=[\w)\]] )[+-](?= [\w(])"), lambda text: "-" if text == "+" else "+"),
    "bound": (re.compile(r"(?<= )(<=|>=|==|!=|<|>)(?= )"), lambda text: _BOUNDS[text]),
    "constant": (re.compile(r"(?<![\w.\"'])\d+(?![\w.\"'])"), lambda text: str(int(text) + 1)),
}
_STATEMENT = re.compile(
    r"^\s*(?!return|throw|using|typedef|public|private)[\w.>\[\]:-]+(\s*([-+*/|&]?=)\s[^{}]*|\([^{}]*\));$"
)
_PYTHON_STATEMENTS = (ast.Assign, ast.AugAssign, ast.Expr, ast.Raise, ast.Delete)
_NOT_COPIED = (".git", ".ws", ".ws-tools", ".venv", "out", ".*_cache", ".hypothesis")
_PYTEST = ("-q", "-x", "-n", "auto", "--dist", "loadfile")
KINDS = (*_CODE, "removed")


@dataclass(frozen=True)
class Mutation:
    """A line of a file, by its path in the tree, and what is to stand there."""

    path: str
    line: int  # from 0
    kind: str
    change: str  # in words
    old: str
    new: str

    def __str__(self) -> str:
        """Say where it is and what it does."""
        return f"{self.path}:{self.line + 1}: {self.change} in: {self.old.strip()}"


@dataclass
class Copy:
    """A built copy of a tree."""

    root: Path
    end: float = 0.0  # when the time for the present mutation is over, by the steady clock
    unsure: set[str] = field(default_factory=set)  # tests that fail without a mutation, too

    def run(self, *command: str) -> subprocess.CompletedProcess[str]:
        """Run a command in its environment."""
        words = ["scripts/run", *command]
        process = children.start(
            words, cwd=self.root, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
        )
        try:
            said, _ = process.communicate(timeout=max(self.end - time.monotonic(), 1.0))
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)  # whatever it started, too
            process.wait()
        return subprocess.CompletedProcess(words, process.returncode, said)

    def write(self, mutation: Mutation, text: str) -> None:
        """Put a text in the place of a mutation."""
        path = self.root / mutation.path
        lines = path.read_text().split("\n")
        lines[mutation.line] = text
        write_whole({path: "\n".join(lines)})


def main(arguments: Sequence[str]) -> int:
    """Run the benchmark. Return 1 if the tree cannot be built."""
    parser = argparse.ArgumentParser(prog="scripts/bench mutations", description=__doc__)
    parser.add_argument("--tree", type=Path, default=Path.cwd(), help="whose src is changed (in a copy); default: here")
    parser.add_argument("--seed", type=int, default=30, help="of the places")
    parser.add_argument("--number", type=int, default=12, help="of mutations")
    parser.add_argument("--limit", type=float, default=1500.0, help="for the checks of one mutation [s]")
    parser.add_argument("--list", action="store_true", help="only say which they are")
    options = parser.parse_args(arguments)
    tree = options.tree.resolve()
    drawn = draw(tree, options.seed, options.number)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell that starts this behind itself has it ignored
    if options.list:
        print("\n".join(str(each) for each in drawn))
        return 0
    with tempfile.TemporaryDirectory(prefix="mutations") as folder:
        copy = copied(tree, Path(folder))
        table = Table("small mistakes in src/, one at a time", "caught by", "after [s]", "place and change")
        caught = 0
        for each in drawn:
            start = time.monotonic()
            copy.end = start + options.limit
            by = judged(copy, each)
            caught += by is not None
            table.row(by or "nothing", time.monotonic() - start, str(each))
        table.note(f"{caught} of {len(drawn)} caught, each within {options.limit:.0f} s.")
    return 0


def draw(tree: Path, seed: int, number: int) -> list[Mutation]:
    """Return mutations at random places of a tree, as many of each kind."""
    found: dict[str, list[tuple[str, Mutation]]] = {kind: [] for kind in KINDS}
    for path in sorted((tree / "src").rglob("*.*")):
        name = path.relative_to(tree).as_posix()
        if path.suffix in (".py", ".cpp", ".h") and not _AWAY.match(name):
            lines = path.read_text().split("\n")
            bare = [re.sub(r"\b[A-Za-z_]\w*", "x", line.strip()) for line in lines]
            for each in mutations(name, lines):
                near = bare[max(each.line - _NEIGHBOURS, 0) : each.line + _NEIGHBOURS + 1]
                key = "\n".join([str(seed), each.kind, *near])
                found[each.kind].append((hashlib.sha256(key.encode()).hexdigest(), each))
    ordered = [[each for _, each in sorted(found[kind], key=lambda pair: pair[0])] for kind in KINDS]
    return [each for some in zip(*ordered, strict=False) for each in some][:number]


def mutations(name: str, lines: list[str]) -> Iterator[Mutation]:
    """Yield a mutation of each kind for each line of code that has one, in its first place."""
    python = name.endswith(".py")
    code, removable = _python(lines) if python else _cpp(lines)
    for i, text in enumerate(code):
        for kind, (pattern, other) in _CODE.items():
            match = pattern.search(text)
            if match:
                new = lines[i][: match.start()] + other(match.group()) + lines[i][match.end() :]
                change = f"{match.group()} becomes {other(match.group())}"
                yield Mutation(name, i, kind, change, lines[i], new)
        if i in removable:
            blank = re.match(r"\s*", lines[i])
            assert blank
            yield Mutation(name, i, "removed", "removed", lines[i], blank.group() + ("pass" if python else ";"))


def _python(lines: list[str]) -> tuple[list[str], set[int]]:
    """Return the lines with strings, comments and imports blanked, and the numbers of those that are a statement."""
    code, removable = list(lines), set()
    tree = ast.parse("\n".join(lines))
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom) or (
            isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))
        ):
            assert node.end_lineno is not None
            for i in range(node.lineno - 1, node.end_lineno):
                code[i] = ""
        docstring = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if (
            isinstance(node, _PYTHON_STATEMENTS)
            and node.lineno == node.end_lineno
            and not docstring
            and node.col_offset
        ):
            removable.add(node.lineno - 1)
    return [re.sub(r"#.*", "", text) for text in code], removable


def _cpp(lines: list[str]) -> tuple[list[str], set[int]]:
    """Return the lines that are code, blanked where they are not, and the numbers of those that are a statement."""
    plain = [text if not re.match(r"\s*(#|//|/?\*|template|using)", text) and '"' not in text else "" for text in lines]
    code = [re.sub(r"//.*", lambda match: " " * len(match.group()), text) for text in plain]
    code = [re.sub(r"<[\w:, *<>]*>", lambda match: "x" * len(match.group()), text) for text in code]
    return code, {i for i, text in enumerate(code) if text.startswith("  ") and _STATEMENT.match(text)}


def copied(tree: Path, folder: Path) -> Copy:
    """Return a built copy of a tree, with the measured data beside it that the tree has."""
    root = folder / "tree"
    shutil.copytree(tree, root, symlinks=True, ignore=shutil.ignore_patterns(*_NOT_COPIED))
    if (tree.parent / "shared").exists():
        (folder / "shared").symlink_to((tree.parent / "shared").resolve())
    for command in (["init", "-q"], ["add", "-A"]):  # some tests ask git for the files
        subprocess.run(["git", *command], cwd=root, check=True)
    ccache = {"CMAKE_CXX_COMPILER_LAUNCHER": "ccache", "CCACHE_BASEDIR": str(root), "CCACHE_NOHASHDIR": "1"}
    built = subprocess.run(
        ["scripts/setup", "--dev"], cwd=root, check=False, capture_output=True, text=True, env={**os.environ, **ccache}
    )
    if built.returncode:
        raise Error(f"{tree}: does not build: {built.stderr[-2000:]}")
    copy = Copy(root, end=time.monotonic() + _BUILD)
    copy.run("mypy")  # so that it knows what has not changed
    _build(copy)
    return copy


def judged(copy: Copy, mutation: Mutation) -> str | None:
    """Return the check that catches a mutation, None if none does in the time there is; leave the copy without it."""
    try:
        while True:
            copy.write(mutation, mutation.new)
            found = next(_failures(copy, mutation), None)
            copy.write(mutation, mutation.old)
            if found is None:
                return None
            copy.end += _AGAIN  # to see whether it is the mutation's
            if found not in _failures(copy, mutation, found):
                return found
            copy.unsure.add(found)
    except subprocess.TimeoutExpired:
        return None
    finally:
        copy.write(mutation, mutation.old)
        if not mutation.path.endswith(".py"):
            copy.end = time.monotonic() + _BUILD
            _build(copy)


def _failures(copy: Copy, mutation: Mutation, only: str = "") -> Iterator[str]:
    """Yield the checks that fail, those that are quick and near first; only: no other than this one."""
    native = not mutation.path.endswith(".py")
    if native:
        if not _build(copy):
            yield "compiler"
            return
    else:
        for name, command in (("ruff", ["ruff", "check", mutation.path]), ("mypy", ["mypy"])):
            if only in ("", name) and name not in copy.unsure and copy.run(*command).returncode:
                yield name
    if only in ("ruff", "mypy", "compiler"):
        return
    parts = [_pytest, _ctest] if not native else [_gtest, _pytest, _ctest]
    for part in parts:
        if found := part(copy, mutation, only):
            yield found


def _build(copy: Copy) -> bool:
    """Build what has changed, tests included. Tell whether it builds."""
    command = ["cmake", "--build", ".ws/build", "--", f"-j{os.cpu_count()}"]
    return not copy.run(*command, "all").returncode and not copy.run(*command, "tests").returncode


def _gtest(copy: Copy, _: Mutation, only: str) -> str:
    return _of_ctest(copy, "gtest", only)


def _ctest(copy: Copy, _: Mutation, only: str) -> str:
    return _of_ctest(copy, "rostest", only)


def _of_ctest(copy: Copy, kind: str, only: str) -> str:
    """Return the first of CMake's tests that fails, empty if none does."""
    if only and kind not in only:
        return ""
    command = ["ctest", "--test-dir", ".ws/build", "--stop-on-failure", "-R", f"^{only}$" if only else f"_{kind}_"]
    unsure = [name for name in copy.unsure if name.startswith("_ctest_")]
    command += ["-E", "|".join(unsure)] if unsure and not only else []
    match = re.search(r"^\s*\d+ - (\S+) \(", copy.run(*command).stdout, re.MULTILINE)
    return match.group(1) if match else ""


def _pytest(copy: Copy, mutation: Mutation, only: str) -> str:
    """Return the first test of pytest that fails, empty if none does."""
    if only and "::" not in only and not only.startswith("tests/"):
        return ""
    files = [only] if only else [str(path.relative_to(copy.root)) for path in nearest(copy.root, mutation.path)]
    if not files:
        return ""
    unsure = [f"--deselect={name}" for name in copy.unsure if not only]
    said = copy.run("env", "OPENBLAS_NUM_THREADS=1", "python", "-m", "pytest", *_PYTEST, *unsure, *files).stdout
    match = re.search(r"^(?:FAILED|ERROR) (\S+?\.py(?:::.*?)?)(?: - .*)?$", said, re.MULTILINE)
    return match.group(1) if match else ""


def nearest(root: Path, changed: str) -> list[Path]:
    """Return the test files of pytest from which imports lead to a changed file, those with the shortest way first.

    What is compiled is reached through the extension modules.
    """
    texts = {path: path.read_text() for folder in ("src", "tests") for path in (root / folder).rglob("*.py")}
    names = {path: _module(root, path) for path in texts}
    if changed.endswith(".py"):
        near, goals = {root / changed}, [names[root / changed]]
    else:
        near, goals = set[Path](), ["kurumaisu._core", "kurumaisu._slam"]
    ordered: list[Path] = []
    for _ in range(len(texts)):
        words = [re.escape(goal) for goal in goals] + [re.escape(goal.rpartition(".")[2]) for goal in goals]
        users = re.compile(
            rf"\b(import|from|[\"'])\b.*\b({'|'.join(words)})\b|^ {{4}}({'|'.join(words)}),$", re.MULTILINE
        )
        new = [path for path, text in texts.items() if path not in near and users.search(text)]
        if not new:
            break
        near.update(new)
        tests = [path for path in new if path.name.startswith("test_")]
        ordered += sorted(tests, key=lambda path: (Path(changed).stem not in path.stem, path))
        goals = [names[path] for path in new]
    return ordered


def _module(root: Path, path: Path) -> str:
    """Return the name by which a file is imported."""
    parts = path.relative_to(root / ("src" if path.is_relative_to(root / "src") else "tests")).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
