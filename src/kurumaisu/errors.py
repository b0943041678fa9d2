# SPDX-License-Identifier: BSD-3-Clause
"""The one exception tree."""

import sys


class Error(Exception):
    """Bad input: the message names the file, line, topic or key, and the value."""


EXCERPT = "\n  | "  # begins a line of the file that a message is about, which follows the message


def one_line(error: BaseException) -> str:
    """Return an error's message on one line, for a log: without the excerpt of the file."""
    return " ".join(str(error).split(EXCERPT)[0].split())


def failed(program: str, error: BaseException) -> int:
    """Say on standard error, in a line, what stopped a program. Return its exit status."""
    print(f"{program}: {one_line(error)}", file=sys.stderr)
    return 1
