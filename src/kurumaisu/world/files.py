# SPDX-License-Identifier: BSD-3-Clause
"""The files a world is made of: where they are looked for, their text, includes and parameters."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from kurumaisu.bounded_files import read_bytes
from kurumaisu.errors import Error
from kurumaisu.names import hint, nearest
from kurumaisu.world.notes import Notes
from kurumaisu.world.tokens import Kind, SourceText, Token, skip_line, tokenize

_MOST_BYTES = 2**26  # of one file
_MOST_TOKENS = 1_000_000  # of a world with its includes; Stage's largest has 40 000
_MOST_OPEN = 1_000  # brackets not closed yet
_DEEPEST = 64  # nested includes; more is a loop

# A parameter `${name}` or `${name=default}` outside of comments; Stage's own language has no `$`.
_PARAMETER = re.compile(r"\$\{([A-Za-z_][A-Za-z0-9_]*)(?:=([^}\r\n]*))?\}")
_BRACES = re.compile(r"\$\{[^}\r\n]*\}?")
_COMMENT_OR_PARAMETER = re.compile(rf'#[^\r\n]*|"[^"\r\n]*"|{_BRACES.pattern}')


def find(name: Token, top: Path, search_path: bool) -> Path:
    """Return the path of a file that a string token names.

    As in Stage it is relative to the folder of the top-level file, and an include's last part is looked for in the
    folders of STAGEPATH; beyond Stage, it may also be beside the file that names it.
    """
    wanted = Path(name.string)
    places = [top.parent / wanted, name.source.path.parent / wanted]
    if search_path:
        places += [Path(folder) / wanted.name for folder in os.environ.get("STAGEPATH", "").split(":") if folder]
    return next((place for place in places if _is_file(place)), places[0])


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name too long, or with a null byte
        return False


@dataclass
class Reader:
    """Reads a world's files, filling in parameters and includes."""

    top: Path
    values: Mapping[str, str]
    notes: Notes
    used: set[str] = field(default_factory=set)
    tokens: list[Token] = field(default_factory=list)
    _open: int = 0  # brackets not closed yet
    _sources: dict[Path, SourceText] = field(default_factory=dict)

    def read(self, text: SourceText | None = None) -> list[Token]:
        """Return the tokens of all files in the order Stage sees them, the last being END; text: instead of the top's.

        Raise Error with the place.
        """
        source = self._source(self.top, None) if text is None else self._fill_in(text)
        self._splice(source, depth=0)
        self.tokens.append(Token(Kind.END, "", source, len(source.text)))
        unused = sorted(set(self.values) - self.used)
        if unused:
            near = hint(unused[0], sorted(self.used))
            raise Error(f"{self.top}: has no parameter ${{{unused[0]}}}, for which a value was given; {near}")
        return self.tokens

    def _splice(self, source: SourceText, depth: int) -> None:
        """Append the tokens of a source without its END."""
        tokens, append = tokenize(source), self.tokens.append
        while (token := next(tokens)).kind is not Kind.END:
            if token.kind is Kind.WORD and token.text == "include":
                tokens = tokenize(source, self._include(token, next(tokens), depth))
                continue
            append(token)
            if token.kind is Kind.OPEN:
                self._open += 1
                if self._open > _MOST_OPEN:
                    raise token.error(f"more than {_MOST_OPEN} levels of brackets")
            elif token.kind is Kind.CLOSE:
                self._open -= 1
            if len(self.tokens) > _MOST_TOKENS:
                raise token.error(f"more than {_MOST_TOKENS} words, numbers and brackets")

    def _include(self, include: Token, name: Token, depth: int) -> int:
        """Splice an included file and return where its line ends: as in Stage, the rest of the line is not read."""
        if name.kind is not Kind.STRING:
            raise name.error(f"include needs a string, not {name}")
        if name.at == include.at + len(include.text):
            raise include.error("include needs a blank before its string")
        if depth == _DEEPEST:
            raise include.error(f"more than {_DEEPEST} levels of includes")
        self.tokens.append(Token(Kind.LINE_END, "\n", include.source, include.at))
        self._splice(self._source(find(name, self.top, search_path=True), name), depth + 1)
        text, end = include.source.text, skip_line(include.source, name.at)
        rest = text[name.at + len(name.text) : end].split("#")[0].strip()
        if rest:
            self.notes.add(include, f"what follows on the line of an include is not read, as in Stage: {rest}")
        return end

    def _source(self, path: Path, asked: Token | None) -> SourceText:
        """Return the text of a file with its parameters filled in."""
        if path not in self._sources:
            self._sources[path] = self._fill_in(self._read(path, asked))
        return self._sources[path]

    def _read(self, path: Path, asked: Token | None) -> SourceText:
        try:
            data = read_bytes(path, _MOST_BYTES)
        except Error as error:
            near = _near(path) if isinstance(error.__cause__, FileNotFoundError) else ""
            reason = f"{error}{near}"
            raise asked.error(reason) if asked else Error(reason) from error
        return SourceText(path, data.decode(errors="surrogateescape"))

    def _fill_in(self, source: SourceText) -> SourceText:
        if "${" not in source.text:
            return source

        def replace(match: re.Match[str]) -> str:
            if match[0].startswith("#"):
                return match[0]
            if match[0].startswith('"'):
                return _BRACES.sub(lambda inner: self._value(source, match.start() + inner.start(), inner[0]), match[0])
            return self._value(source, match.start(), match[0])

        return SourceText(source.path, _COMMENT_OR_PARAMETER.sub(replace, source.text))

    def _value(self, source: SourceText, at: int, text: str) -> str:
        """Return the value of a parameter written as text."""
        match = _PARAMETER.fullmatch(text)
        if match is None:
            raise source.error(at, f"a parameter is written as ${{name}} or ${{name=default}}, not as {text}")
        name, default = match.groups()
        self.used.add(name)
        value = self.values.get(name, default)
        if value is None:
            raise source.error(at, f"the parameter {name} has no value here: give {name}=VALUE")
        if re.search(r"[\r\n]", value):
            raise source.error(at, f"the value of the parameter {name} has more than one line")
        return value


def _near(path: Path) -> str:
    """Return which worlds beside a missing file have a like name."""
    there = sorted(file.name for file in path.parent.glob(f"*{path.suffix}")) if path.suffix else []
    near = nearest(path.name, there)
    return f"; did you mean {' or '.join(near)}?" if near else ""


def parse_values(given: Iterable[str]) -> dict[str, str]:
    """Return values for a world's parameters, each given as NAME=VALUE. Raise Error for what is not."""
    values = {}
    for value in given:
        name, equals, text = value.partition("=")
        if not equals:
            raise Error(f"{value!r}: a parameter is given as NAME=VALUE")
        values[name] = text
    return values
