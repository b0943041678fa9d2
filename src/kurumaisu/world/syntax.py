# SPDX-License-Identifier: BSD-3-Clause
"""Entities and properties of a Stage world file: define, include, nesting and tuples."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from kurumaisu.errors import Error
from kurumaisu.world.tokens import Kind, Token, number, tokenize

Value = float | str

_DEEPEST = 64  # nested includes and macros; more is a loop


@dataclass(frozen=True)
class Property:
    """A property's values and its name's place in the file."""

    name: Token
    values: tuple[Value, ...]

    def numbers(self, least: int, most: int) -> tuple[float, ...]:
        """Return so many numbers. Raise Error at anything else."""
        count = f"{least}" if least == most else f"{least} to {most}"
        if not least <= len(self.values) <= most:
            raise self.name.error(f"{self.name.text} needs {count} numbers, not {len(self.values)}")
        return tuple(self._number(value) for value in self.values)

    def _number(self, value: Value) -> float:
        if isinstance(value, str):
            raise self.name.error(f"{self.name.text} needs a number, not {value!r}")
        return value

    def text(self) -> str:
        """Return one string. Raise Error at anything else."""
        if len(self.values) != 1 or not isinstance(self.values[0], str):
            raise self.name.error(f"{self.name.text} needs a string")
        return self.values[0]


@dataclass
class Entity:
    """An entity: its type (macros resolved), the word that made it, properties and children in file order."""

    type: str
    name: Token
    properties: dict[str, Property] = field(default_factory=dict)
    children: list[Entity] = field(default_factory=list)


@dataclass(frozen=True)
class _Macro:
    base: Token
    body: list[Token]


def parse(path: Path) -> Entity:
    """Return the world entity of a file. Raise Error with file, line and column for what does not parse."""
    top = Token(Kind.WORD, "world", path, 1, 1)
    world = Entity("world", top)
    _Parser(path).body(_Tokens(read_tokens(path, top)), world, Kind.END, depth=0)
    return world


def read_tokens(path: Path, place: Token) -> list[Token]:
    """Return the tokens of a file that is asked for at a place."""
    try:
        return tokenize(path.read_bytes().decode(), path)
    except OSError as error:
        where = f"{path}: " if place.file == path else f"{place.file}:{place.line}:{place.column}: {path}: "
        raise Error(f"{where}{error.strerror}") from error
    except UnicodeDecodeError as error:
        raise Error(f"{path}: is not UTF-8 text") from error


class _Tokens:
    """A list of tokens with a place in it."""

    def __init__(self, tokens: list[Token]) -> None:
        self._tokens = tokens
        self._at = 0

    def peek(self) -> Token:
        return self._tokens[self._at]

    def take(self) -> Token:
        token = self.peek()
        if token.kind is not Kind.END:
            self._at += 1
        return token

    def expect(self, kind: Kind, after: str) -> Token:
        token = self.take()
        if token.kind is not kind:
            raise token.error(f"{after} needs {kind.value}, not {token}")
        return token

    def skip_line_ends(self) -> None:
        while self.peek().kind is Kind.LINE_END:
            self.take()

    def enclosed(self, opening: Token) -> list[Token]:
        """Take all up to the parenthesis that closes the one just taken; the result ends in CLOSE."""
        body = []
        depth = 1
        while depth:
            token = self.take()
            if token.kind is Kind.END:
                raise opening.error("'(' is never closed")
            depth += (token.kind is Kind.OPEN) - (token.kind is Kind.CLOSE)
            body.append(token)
        return body


class _Parser:
    """Macros known so far, and the rules."""

    def __init__(self, top: Path) -> None:
        self._folder = top.parent  # includes are relative to the first file, as in Stage
        self._macros: dict[str, _Macro] = {}

    def body(self, tokens: _Tokens, entity: Entity, end: Kind, depth: int) -> None:
        """Read properties and children into the entity, up to the end: CLOSE, or END for that of a file."""
        if depth > _DEEPEST:
            raise entity.name.error(f"more than {_DEEPEST} levels of includes, macros and entities")
        while True:
            tokens.skip_line_ends()
            token = tokens.take()
            if token.kind is end:
                return
            if token.kind is Kind.END:
                raise entity.name.error(f"the '(' of {entity.name.text} is never closed")
            if token.kind is not Kind.WORD:
                raise token.error(f"expected a property or an entity, not {token}")
            if token.text == "define":
                self._define(tokens, token, entity)
            elif token.text == "include":
                name = tokens.expect(Kind.STRING, "include")
                included = _Tokens(read_tokens(self._folder / name.text[1:-1], name))
                self.body(included, entity, Kind.END, depth + 1)
            else:
                self._property_or_child(tokens, token, entity, depth)

    def _define(self, tokens: _Tokens, define: Token, entity: Entity) -> None:
        if entity.type != "world":
            raise define.error("define is allowed at the top level only")
        name = tokens.expect(Kind.WORD, "define")
        base = tokens.expect(Kind.WORD, "define")
        tokens.skip_line_ends()
        body = tokens.enclosed(tokens.expect(Kind.OPEN, "define"))
        self._macros.setdefault(name.text, _Macro(base, body))  # the first definition wins, as in Stage

    def _property_or_child(self, tokens: _Tokens, word: Token, entity: Entity, depth: int) -> None:
        if tokens.peek().kind in (Kind.OPEN, Kind.LINE_END):
            tokens.skip_line_ends()
            if tokens.take().kind is not Kind.OPEN:
                raise word.error(f"{word.text} needs a value on its line, or '('")
            child = Entity(word.text, word)
            entity.children.append(child)
            self._instance(child, depth + 1)
            self.body(tokens, child, Kind.CLOSE, depth + 1)
            return
        entity.properties[word.text] = Property(word, self._values(tokens, word))

    def _instance(self, entity: Entity, depth: int) -> None:
        """Read the macro that the entity's type names, if it is one, into the entity: base first."""
        macro = self._macros.get(entity.type)
        if macro is None:
            return
        if depth > _DEEPEST:
            raise macro.base.error(f"macro {entity.type} never ends")
        entity.type = macro.base.text
        self._instance(entity, depth + 1)
        self.body(_Tokens(macro.body), entity, Kind.CLOSE, depth + 1)

    def _values(self, tokens: _Tokens, name: Token) -> tuple[Value, ...]:
        token = tokens.take()
        if token.kind is not Kind.OPEN_TUPLE:
            return (self._value(token, name),)
        values: list[Value] = []
        while tokens.peek().kind is not Kind.CLOSE_TUPLE:
            values.append(self._value(tokens.take(), name))
        tokens.take()
        return tuple(values)

    def _value(self, token: Token, name: Token) -> Value:
        if token.kind is Kind.NUMBER:
            return number(token)
        if token.kind is Kind.STRING:
            return token.text[1:-1]
        raise token.error(f"{name.text} needs a number or a string on its line, not {token}")
