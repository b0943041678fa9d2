# SPDX-License-Identifier: BSD-3-Clause
"""clang-tidy on every C++ file of the build that, or whose headers, changed since it was last found clean."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import sources

BUILD = sources.ROOT / ".ws/build"
CLEAN = sources.ROOT / ".ws/tidy"  # one empty file per clean state of a file


def main() -> int:
    """Check the files, as many at once as there are cores; return 1 if any has findings."""
    CLEAN.mkdir(parents=True, exist_ok=True)
    version = subprocess.run(["clang-tidy", "--version"], check=True, capture_output=True, text=True).stdout
    configs = [path for path in sources.files() if path.name == ".clang-tidy"]
    commands = json.loads((BUILD / "compile_commands.json").read_text())
    # a file that two targets compile is checked once
    units = list({unit["file"]: unit for unit in commands if _ours(unit)}.values())
    # what Python compiles by itself, against programs that are not ours to install, is in no target
    programs = {path for path in sources.files(".cpp") if not path.is_relative_to(sources.ROOT / "src/kurumaisu")}
    missing = programs - {Path(unit["file"]).resolve() for unit in units}
    for path in sorted(missing):
        print(f"{path}: is in no target, so nothing compiles it")
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        findings = [text for text in pool.map(lambda unit: _check(unit, configs, version), units) if text]
    print("\n".join(findings) or f"{len(units)} files")
    return 1 if findings or missing else 0


def _ours(unit: dict[str, str]) -> bool:
    path = Path(unit["file"]).resolve()
    return path.is_relative_to(sources.ROOT) and not path.is_relative_to(sources.ROOT / ".ws")


def _check(unit: dict[str, str], configs: list[Path], version: str) -> str:
    """Return clang-tidy's findings, empty if there are none."""
    state = sources.content_hash({*_dependencies(unit), *configs}, version, unit["command"])
    if (CLEAN / state).exists():
        return ""
    # Links into the workspace are kept: HeaderFilterRegex and clang then see the same paths as gcc does.
    command = ["clang-tidy", "--quiet", "-p", str(BUILD), unit["file"]]
    run = subprocess.run(command, check=False, capture_output=True, text=True)
    if run.returncode != 0:
        lines = [line for line in run.stdout.splitlines() if re.search(r": (error|warning): ", line)]
        return "\n".join(dict.fromkeys(lines)) or run.stdout + run.stderr
    (CLEAN / state).touch()
    return ""


def _dependencies(unit: dict[str, str]) -> set[Path]:
    """Return the file and the headers of this tree that it includes, as gcc noted; else all headers."""
    words = shlex.split(unit["command"])
    depfile = Path(unit["directory"]) / f"{words[words.index('-o') + 1]}.d"
    names = depfile.read_text().replace("\\\n", " ").split()[1:] if depfile.exists() else []
    headers = {Path(name).resolve() for name in names} or set(sources.files(".h"))
    return {p for p in headers if p.is_relative_to(sources.ROOT) and p.exists()} | {Path(unit["file"]).resolve()}


if __name__ == "__main__":
    sys.exit(main())
