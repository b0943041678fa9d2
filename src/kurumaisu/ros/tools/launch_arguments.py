# SPDX-License-Identifier: BSD-3-Clause
"""launch_arguments: the names that roslaunch was given on its command line, of which it takes any."""

from __future__ import annotations

import os
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Sequence
from pathlib import Path

from kurumaisu import program
from kurumaisu.names import hint

_ABOUT = "Check the arguments that roslaunch, which runs this as it reads a launch file, was given for it."


def main() -> int:
    """Return 1, which stops the roslaunch that runs this, for an argument of no use."""
    parser = program.Parser(prog="launch_arguments", description=_ABOUT)
    parser.add_argument("folder", type=Path, help="with the launch files")
    folder = parser.parse_args().folder
    words = Path(f"/proc/{os.getppid()}/cmdline").read_text(errors="replace").split("\0")
    if any(Path(word).name == "roslaunch" for word in words[:2]):  # as the shell started it: not from a program
        wrong = mistyped(words[2:], folder)
        if wrong:
            print(f"roslaunch: {wrong}", file=sys.stderr)
            return 1
    print("checked")
    return 0


def mistyped(words: Sequence[str], folder: Path) -> str:
    """Return what is wrong with the arguments on a command line, '' if they are of files that are not in the folder."""
    files = [Path(word) for word in words if word.endswith(".launch") and ":=" not in word]
    ours = [folder / file.name for file in files if (folder / file.name).is_file()]
    if not files or len(ours) < len(files) or any(_is_other(file, folder) for file in files):
        return ""
    known = [name for file in ours for name in arguments(file)]
    for word in words:
        name, given, _ = word.partition(":=")
        if given and not name.startswith("_") and name not in known:
            return f"{word}: {' and '.join(file.name for file in ours)}: no argument {name}; {hint(name, known)}"
    return ""


def arguments(file: Path) -> Iterator[str]:
    """Yield the names of a launch file's arguments, and of the files beside it that get all of them."""
    for element in _outside_includes(ElementTree.parse(file).getroot()):
        if element.tag == "arg" and "value" not in element.attrib:
            yield element.attrib["name"]
        elif element.tag == "include" and element.get("pass_all_args") == "true":
            yield from arguments(file.parent / Path(element.attrib["file"]).name)


def _is_other(file: Path, folder: Path) -> bool:
    """Return whether it is a file of somebody else's that has the name of one of ours."""
    return file.exists() and not file.samefile(folder / file.name)


def _outside_includes(element: ElementTree.Element) -> Iterator[ElementTree.Element]:
    for child in element:
        yield child
        if child.tag != "include":
            yield from _outside_includes(child)
