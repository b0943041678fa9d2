# SPDX-License-Identifier: BSD-3-Clause
"""The one exception tree, and how values from outside are told in its messages."""

import reprlib
import sys
from typing import Any

_LONGEST = 1500  # characters of a message
_LEFT_OUT = " ... "
_LONGEST_VALUE = 100  # characters of a value in it


class Error(Exception):
    """Bad input: the message names the file, line, topic or key, and the value.

    The middle of a message that is longer than anybody reads is left out.
    """

    def __str__(self) -> str:
        text = super().__str__()
        half = (_LONGEST - len(_LEFT_OUT)) // 2
        return text if len(text) <= _LONGEST else f"{text[:half]}{_LEFT_OUT}{text[-half:]}"


EXCERPT = "\n  | "  # begins a line of the file that a message is about, which follows the message


class _Short(reprlib.Repr):
    """What repr returns, of a few items and levels only: some values are larger written out than in memory."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel, self.maxstring, self.maxlong, self.maxother = 3, 60, 40, 60
        self.maxlist = self.maxtuple = self.maxset = self.maxdict = 6

    def repr_int(self, x: int, level: int) -> str:
        try:
            return super().repr_int(x, level)
        except ValueError:  # too many digits even to be counted in decimals
            return f"an integer of {x.bit_length()} bits"


def told(value: Any) -> str:
    """Return a value as Python writes it, cut to what a message has room for."""
    text = _Short().repr(value)
    return text if len(text) <= _LONGEST_VALUE else f"{text[: _LONGEST_VALUE - 3]}..."


def one_line(error: BaseException) -> str:
    """Return an error's message on one line, for a log: without the excerpt of the file."""
    return " ".join(str(error).split(EXCERPT)[0].split())


def failed(program: str, error: BaseException) -> int:
    """Say on standard error, in a line, what stopped a program. Return its exit status."""
    print(f"{program}: {one_line(error)}", file=sys.stderr)
    return 1
