# SPDX-License-Identifier: BSD-3-Clause
"""clang-tidy on all that the build compiles and that, or whose headers, changed since it was last found clean.

What a unity build compiles at once is checked at once, for most of the time goes into what the sources include, but the
other way round: so a source that lacks an include is found by one of the two, unless sources on both sides of it have
that. Where something is found there, each source is checked alone, too, as that says it best. Two checks look only at
sources that are checked alone, misc-unused-using-decls and misc-unused-alias-decls: unused() does what they do.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import sources

BUILD = sources.ROOT / ".ws/build"
LINKS = sources.ROOT / ".ws/src/kurumaisu"  # the tree as the build sees it
# one empty file per clean state of a unit, for all clones of a user, as ccache does
CLEAN = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "kurumaisu/tidy"
WHOLE = sources.ROOT / ".ws/tidy"  # what is checked at once, in folders as src/ and tests/, with their settings


@dataclass(frozen=True)
class Unit:
    """What a call of the compiler made of sources, all of one folder or nearly so."""

    flags: list[str]  # of the compiler, but for what it reads and writes
    made: Path  # the object
    directory: Path
    sources: tuple[Path, ...]  # as the build sees them: links into the workspace

    @property
    def name(self) -> str:
        """Return a name that no other unit has."""
        return "_".join(self.made.relative_to(BUILD / "kurumaisu").parts)


def main() -> int:
    """Check the files, as many at once as there are cores; return 1 if any has findings."""
    CLEAN.mkdir(parents=True, exist_ok=True)
    shutil.rmtree(WHOLE, ignore_errors=True)
    version = subprocess.run(["clang-tidy", "--version"], check=True, capture_output=True, text=True).stdout
    configs = [path for path in sources.files() if path.name == ".clang-tidy"]
    for path in configs:
        copy = WHOLE / path.relative_to(sources.ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, copy)
    units = _units()
    files = {path.resolve() for unit in units for path in unit.sources}
    # what Python compiles by itself, against programs that are not ours to install, is in no target
    programs = {path for path in sources.files(".cpp") if not path.is_relative_to(sources.ROOT / "src/kurumaisu")}
    missing = programs - files
    for path in sorted(missing):
        print(f"{path}: is in no target, so nothing compiles it")
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        findings = [text for text in pool.map(lambda unit: _check(unit, configs, version), units) if text]
    print("\n".join(findings) or f"{len(files)} files")
    return 1 if findings or missing else 0


def _units() -> list[Unit]:
    """Return what is compiled of this tree, each source once; the largest first, lest one core waits for it."""
    units, seen = [], set[Path]()
    for entry in json.loads((BUILD / "compile_commands.json").read_text()):
        words, path = shlex.split(entry["command"]), Path(entry["file"])
        first, here = next(i for i, word in enumerate(words) if word.startswith("-")), words.index("-o")
        text = path.read_text() if path.is_relative_to(BUILD) else f'#include "{path}"'
        all_of_it = [Path(name) for name in re.findall(r'^#include "(.*)"$', text, re.MULTILINE)]
        ours = tuple(p for p in all_of_it if p.is_relative_to(LINKS) and p not in seen)
        seen.update(ours)
        if ours:
            made = Path(entry["directory"]) / words[here + 1]
            units.append(Unit(words[first:here], made, Path(entry["directory"]), ours))
    return sorted(units, key=lambda unit: -len(unit.sources))


def _check(unit: Unit, configs: list[Path], version: str) -> str:
    """Return clang-tidy's findings, empty if there are none."""
    flags = [flag.replace(f"{sources.ROOT}/", "") for flag in unit.flags]
    state = sources.content_hash({*_dependencies(unit), *configs}, version, *flags)
    if (CLEAN / state).exists():
        return ""
    findings = ""
    if len(unit.sources) > 1:
        findings = "\n".join([line for path in unit.sources for line in unused(path)]) or _tidy(unit, _whole(unit))
    if findings or len(unit.sources) == 1:
        each = [text for path in unit.sources if (text := _tidy(unit, path))]
        findings = "\n".join(each) or findings
    if not findings:
        (CLEAN / state).touch()
    return findings


def unused(path: Path) -> list[str]:
    """Return a line for each name that a source takes from another namespace and does not use."""
    text = re.sub(r'//.*|(?s:/\*.*?\*/)|"(\\.|[^"\\\n])*"', "", path.read_text())
    taken = [*re.findall(r"^\s*using\s+[\w:]*::(\w+);", text, re.MULTILINE)]
    taken += re.findall(r"^\s*namespace\s+(\w+)\s*=", text, re.MULTILINE)
    used = re.sub(r"^\s*(using\s+[\w:]+;|namespace\s+\w+\s*=)", "", text, flags=re.MULTILINE)
    return [f"{path}: {name} is not used" for name in taken if not re.search(rf"(?<!::)\b{name}\b", used)]


def _whole(unit: Unit) -> Path:
    """Write a file that includes all sources, where clang-tidy finds the settings of their folder."""
    # by UnifiedSource in its name the analyzer knows that what this includes is no header
    path = WHOLE / unit.sources[0].parent.relative_to(LINKS) / f"UnifiedSource_{unit.name}.cpp"
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = [f'#include "{source}"  // NOLINT(bugprone-suspicious-include)' for source in reversed(unit.sources)]
    path.write_text("\n".join([*lines, ""]))
    return path


def _tidy(unit: Unit, path: Path) -> str:
    """Return what clang-tidy finds in a file, compiled as the unit is, empty if there is nothing."""
    # Links into the workspace are kept: HeaderFilterRegex and clang then see the same paths as gcc does.
    command = ["clang-tidy", "--quiet", str(path), "--", *unit.flags, "-Wno-unknown-warning-option"]
    run = subprocess.run(command, check=False, capture_output=True, text=True, cwd=unit.directory)
    if run.returncode == 0:
        return ""
    lines = [line for line in run.stdout.splitlines() if re.search(r": (error|warning): ", line)]
    return "\n".join(dict.fromkeys(lines)) or run.stdout + run.stderr


def _dependencies(unit: Unit) -> set[Path]:
    """Return the sources and the headers that they include, as gcc noted; else all headers of this tree."""
    depfile = Path(f"{unit.made}.d")
    if depfile.exists():
        headers = {Path(name).resolve() for name in depfile.read_text().replace("\\\n", " ").split()[1:]}
    else:
        headers = set(sources.files(".h"))
    return {p for p in headers if p.exists()} | {path.resolve() for path in unit.sources}


if __name__ == "__main__":
    sys.exit(main())
