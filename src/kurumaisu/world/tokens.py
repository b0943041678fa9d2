# SPDX-License-Identifier: BSD-3-Clause
"""Words, numbers and strings of a Stage world file."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from kurumaisu.errors import Error


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


@dataclass(frozen=True)
class Token:
    """One token and where it stands; line and column count from 1."""

    kind: Kind
    text: str
    file: Path
    line: int
    column: int

    def error(self, message: str) -> Error:
        """Return an Error at this token."""
        return Error(f"{self.file}:{self.line}:{self.column}: {message}")

    def __str__(self) -> str:
        return f"{self.kind.value} {self.text}" if self.kind in _WITH_TEXT else self.kind.value


_WITH_TEXT = (Kind.WORD, Kind.NUMBER, Kind.STRING)

# Stage's rules: brackets belong to words (point[0]), numbers have no exponent, strings no escapes.
_TOKEN = re.compile(
    r"""(?P<blank>[ \t]+|\#[^\r\n]*)
      | (?P<line_end>\r\n|\n\r|\r|\n)
      | (?P<word>[A-Za-z][A-Za-z0-9.\-_\[\]]*)
      | (?P<number>[-+.0-9]+)
      | (?P<string>"[^"\r\n]*")
      | (?P<open>\() | (?P<close>\)) | (?P<open_tuple>\[) | (?P<close_tuple>\])""",
    re.VERBOSE,
)


def tokenize(text: str, file: Path) -> list[Token]:
    """Return the tokens of a file's text, the last being END. Raise Error at what is no token."""
    tokens = []
    line, line_start, at = 1, 0, 0
    while at < len(text):
        match = _TOKEN.match(text, at)
        here = Token(Kind.END, "", file, line, at - line_start + 1)
        if match is None:
            what = "a string is not closed on its line" if text[at] == '"' else f"{text[at]!r} is not allowed"
            raise here.error(what)
        name = str(match.lastgroup)
        if name != "blank":
            tokens.append(Token(Kind[name.upper()], match.group(), file, line, here.column))
        at = match.end()
        if name == "number" and text[at : at + 1].isalpha():
            raise here.error(f"{match.group()}{text[at]} is not a number: exponents are not allowed")
        if name == "line_end":
            line, line_start = line + 1, at
    tokens.append(Token(Kind.END, "", file, line, at - line_start + 1))
    return tokens


def number(token: Token) -> float:
    """Return the value of a number token. Raise Error at one like '1.2.3'."""
    try:
        return float(token.text)
    except ValueError as error:
        raise token.error(f"{token.text} is not a number") from error
