# SPDX-License-Identifier: BSD-3-Clause
"""The sections of a page of docs/ that benchmarks write: from `<!-- bench NAME -->` to `<!-- end -->`.

A section has the command, and the tables that it printed.
"""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from kurumaisu.bench.table import Table
from kurumaisu.errors import Error
from kurumaisu.whole_files import write_whole

_END = "<!-- end -->"
_SECTION = re.compile(rf"^(<!-- (\w+) (\w+) -->)\n(.*?)^({re.escape(_END)})$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Section:
    """A section of a page: 'bench' or 'real', which benchmark or recording, and the arguments of its command."""

    program: str
    name: str
    arguments: list[str]


def sections(text: str) -> list[Section]:
    """Return the sections of a page. Raise Error for one that does not begin with its own command."""
    found = []
    for _, program, name, body, _ in _SECTION.findall(text):
        command = shlex.split(body.split("\n", 1)[0], comments=True)
        if command[:2] != [f"scripts/{program}", name]:
            raise Error(f"<!-- {program} {name} -->: the next line is not its command: {' '.join(command)!r}")
        found.append(Section(program, name, command[2:]))
    return found


def check(path: Path, program: str, name: str) -> None:
    """Raise Error if a page is not there, or has not exactly one section for a benchmark."""
    count = sum((one, other) == (program, name) for _, one, other, _, _ in _SECTION.findall(_read(path)))
    if count != 1:
        raise Error(f"{path}: has {count} sections from `<!-- {program} {name} -->` to `{_END}`, not one")


def write(path: Path, program: str, name: str, arguments: Sequence[str], tables: Sequence[Table]) -> None:
    """Put a command and its tables in place of a section of a page. Raise Error as `check` does."""
    check(path, program, name)
    if not tables:
        raise Error(f"{path}: scripts/{program} {name} made no table")
    command = f"    scripts/{shlex.join([program, name, *shown(arguments)])}    # on {os.cpu_count()} cores"
    wanted = [table for table in tables if table.page] or tables
    body = "\n\n".join([command, *(table.markdown() for table in wanted)])

    def replaced(match: re.Match[str]) -> str:
        begin, one, other, _, end = match.groups()
        return f"{begin}\n{body}\n{end}" if (one, other) == (program, name) else match.group()

    write_whole({path: _SECTION.sub(replaced, _read(path))})


def shown(arguments: Sequence[str]) -> list[str]:
    """Return arguments without the paths of this machine: for each the name of its option, FOLDER if it has none."""
    out: list[str] = []
    option = ""
    for argument in arguments:
        name, equals, value = argument.partition("=")
        if argument.startswith("--") and equals and value.startswith("/"):
            out.append(f"{name}={_placeholder(name)}")
        elif argument.startswith("/"):
            out.append(_placeholder(option))
        else:
            out.append(argument)
        option = argument if argument.startswith("--") else ""
    return out


def _placeholder(option: str) -> str:
    return option.lstrip("-").replace("-", "_").upper() or "FOLDER"


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise Error(f"{path}: {error.strerror}") from error
