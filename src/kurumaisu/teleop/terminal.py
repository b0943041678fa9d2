# SPDX-License-Identifier: BSD-3-Clause
"""Single keys from a terminal."""

from __future__ import annotations

import contextlib
import os
import select
import termios
import tty
from types import TracebackType

from kurumaisu.errors import Error


class Terminal:
    """A terminal that gives each key at once and shows none; as it was, afterwards."""

    def __init__(self, descriptor: int) -> None:
        """Raise Error for what is no terminal."""
        self._descriptor = descriptor
        try:
            self._before = termios.tcgetattr(descriptor)
        except termios.error as error:
            raise Error("teleop_keyboard: standard input is not a terminal: start it in one, with rosrun") from error

    def __enter__(self) -> Terminal:
        tty.setcbreak(self._descriptor)  # Ctrl-C still interrupts
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        with contextlib.suppress(termios.error):  # it was closed
            termios.tcsetattr(self._descriptor, termios.TCSADRAIN, self._before)

    def keys(self, seconds: float) -> str | None:
        """Return what was typed, after at most so many seconds; None once the terminal is gone.

        Of an arrow key and its like, which send several characters, only the escape is left: a key that stops.
        """
        if not select.select([self._descriptor], [], [], seconds)[0]:
            return ""
        try:
            data = os.read(self._descriptor, 1024)
        except OSError:
            return None
        if not data:
            return None
        text = data.decode(errors="replace")
        return "\x1b" if "\x1b" in text else text
