# SPDX-License-Identifier: BSD-3-Clause
"""The one exception tree."""


class Error(Exception):
    """Bad input: the message names the file, line, topic or key, and the value."""


def one_line(error: BaseException) -> str:
    """Return an error's message on one line, for a terminal."""
    return " ".join(str(error).split())
