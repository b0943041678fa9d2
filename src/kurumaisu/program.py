# SPDX-License-Identifier: BSD-3-Clause
"""The command line of a program or node. --help and a wrong option need no master."""

from __future__ import annotations

import argparse
import gc
import os
import signal
import sys
from collections.abc import Sequence
from typing import Any

from kurumaisu.names import hint

_ROS = "OLD:=NEW renames a topic or service, _KEY:=VALUE sets a parameter, __name:=NAME\nthe node's name."


class Parser(argparse.ArgumentParser):
    """Says of an unknown name or part which are near it, not all that there are."""

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            known = [str(choice) for choice in action.choices]
            raise argparse.ArgumentError(action, f"there is no {str(value)!r}; {hint(str(value), known)}")


def text_parser(name: str, about: str, epilog: str, **more: Any) -> Parser:
    """Return a parser whose help has its texts as they are, and whose options have no short cuts."""
    form = argparse.RawDescriptionHelpFormatter
    return Parser(prog=name, description=about, epilog=epilog, formatter_class=form, allow_abbrev=False, **more)


def node_parser(name: str, text: str) -> Parser:
    """Return the parser of a node. text: a paragraph on what it does; then topics, services, parameters."""
    about, _, names = text.strip().partition("\n\n")
    return text_parser(name, about, f"{names}\n\n{_ROS}".strip())


def words(arguments: Sequence[str] | None = None) -> list[str]:
    """Return the command line without what is ROS's: roslaunch gives every node its name."""
    hold_standard_streams()
    return [word for word in (sys.argv[1:] if arguments is None else arguments) if ":=" not in word]


def hold_standard_streams() -> None:
    """Open /dev/null for those that were closed: else a file or device takes the number, and gets the messages."""
    for stream in range(3):
        try:
            os.fstat(stream)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest number that is free: this one


def no_arguments(name: str, text: str) -> None:
    """End the program for --help, or with 2 for any argument that is not ROS's; text as of node_parser."""
    node_parser(name, text).parse_args(words())


def load_a_node() -> None:
    """Prepare to load the modules of a node.

    Ctrl-C ends the program meanwhile: a KeyboardInterrupt may get lost in an import. No garbage is looked for, which
    there is hardly any of, until `loaded` is called.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    gc.disable()


def loaded() -> None:
    """Look for garbage from now on, but not among what has been loaded."""
    gc.freeze()
    gc.enable()
