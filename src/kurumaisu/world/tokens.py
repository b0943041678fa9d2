# SPDX-License-Identifier: BSD-3-Clause
"""Words, numbers and strings of a Stage world file, and where each stands."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from kurumaisu.errors import EXCERPT, Error
from kurumaisu.world.model import Place

_WIDEST = 100  # characters of a line that an error shows on either side of its place


class Kind(Enum):
    """Kinds of token."""

    WORD = "a word"
    NUMBER = "a number"
    STRING = "a string"
    OPEN = "'('"
    CLOSE = "')'"
    OPEN_TUPLE = "'['"
    CLOSE_TUPLE = "']'"
    LINE_END = "the end of the line"
    END = "the end of the file"


@dataclass(frozen=True, eq=False)
class SourceText:
    """The text of one file; bytes that are not UTF-8 are in it as lone surrogates."""

    path: Path
    text: str

    @cached_property
    def _line_starts(self) -> list[int]:
        return [0, *(match.end() for match in _LINE_END.finditer(self.text))]

    def place(self, at: int) -> Place:
        """Return line and column of an offset into the text."""
        line = bisect_right(self._line_starts, at)
        return Place(self.path, line, at - self._line_starts[line - 1] + 1)

    def error(self, at: int, message: str) -> Error:
        """Return an Error at an offset into the text, with the line and a caret under the place."""
        place = self.place(at)
        start = max(self._line_starts[place.line - 1], at - _WIDEST)
        shown = re.split(r"[\r\n]", self.text[start : at + _WIDEST], maxsplit=1)[0]
        shown = "".join(c if c.isprintable() or c == "\t" else "\ufffd" for c in shown)
        under = "".join("\t" if c == "\t" else " " for c in shown[: at - start])
        return Error(f"{place}: {message}{EXCERPT}{shown}{EXCERPT}{under}^")


class Token(NamedTuple):
    """One token: its text as in the file and where that begins."""

    kind: Kind
    text: str
    source: SourceText
    at: int

    @property
    def place(self) -> Place:
        """File, line and column."""
        return self.source.place(self.at)

    def error(self, message: str) -> Error:
        """Return an Error at this token."""
        return self.source.error(self.at, message)

    @property
    def string(self) -> str:
        """What a string says, or the text of any other token."""
        return self.text[1:-1] if self.kind is Kind.STRING else self.text

    def __str__(self) -> str:
        return f"{self.kind.value} {self.text}" if self.kind in _WITH_TEXT else self.kind.value


_WITH_TEXT = (Kind.WORD, Kind.NUMBER, Kind.STRING)

# Stage's rules (libstage/worldfile.cc): brackets belong to words (point[0]), numbers have no exponent, strings no
# escapes; a line feed after a carriage return and the other way round belong to the same line end.
_LINE_END = re.compile(r"\r\n|\n\r|\r|\n")
_TOKEN = re.compile(
    r"""(?:[ \t]++ | \#[^\r\n]*+)*+
      (?:(?P<WORD>[A-Za-z][A-Za-z0-9.\-_\[\]]*)
      | (?P<NUMBER>[-+.0-9]+)
      | (?P<LINE_END>\r\n|\n\r|\r|\n)
      | (?P<STRING>"[^"\r\n]*")
      | (?P<OPEN>\() | (?P<CLOSE>\)) | (?P<OPEN_TUPLE>\[) | (?P<CLOSE_TUPLE>\])
      | (?P<END>\Z))""",
    re.VERBOSE,
)
_BLANK = re.compile(r"(?:[ \t]++|#[^\r\n]*+)*+")
_KINDS = {kind.name: kind for kind in Kind}


def tokenize(source: SourceText, at: int = 0) -> Iterator[Token]:
    """Give the tokens of a file from an offset on, the last being END. Raise Error at what is no token."""
    text, scan = source.text, _TOKEN.match
    while True:
        match = scan(text, at)
        if match is None:
            raise _not_a_token(source, at)
        name = match.lastgroup or "END"
        at = match.end()
        yield Token(_KINDS[name], match[name], source, match.start(name))
        if name == "END":
            return


def skip_line(source: SourceText, at: int) -> int:
    """Return the offset after the line end that follows an offset."""
    match = _LINE_END.search(source.text, at)
    return match.end() if match else len(source.text)


def _not_a_token(source: SourceText, at: int) -> Error:
    blank = _BLANK.match(source.text, at)
    at = blank.end() if blank else at
    character = source.text[at]
    if character == '"':
        return source.error(at, "a string is not closed on its line")
    if character == "\ufeff":
        return source.error(at, "a byte order mark is not allowed: save the file without it")
    if character == "<" and not source.text[:at].strip():
        return source.error(at, "this is XML (SDF, URDF, a launch file?), not a Stage world")
    if 0xDC80 <= ord(character) <= 0xDCFF:
        return source.error(at, f"byte 0x{ord(character) - 0xDC00:02x} is not allowed outside of comments and strings")
    return source.error(at, f"{character!r} is not allowed")
