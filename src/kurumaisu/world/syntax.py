# SPDX-License-Identifier: BSD-3-Clause
"""Entities and properties of a Stage world file: define, nesting and tuples, as libstage/worldfile.cc reads them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from kurumaisu.world.files import Reader
from kurumaisu.world.notes import Notes
from kurumaisu.world.tokens import Kind, SourceText, Token

_DEEPEST = 100  # levels of entities in entities, and of macros of macros
_MOST_STEPS = 2_000_000  # properties and entities read; the largest world of Stage's own comes to some ten thousand

_VALUES = (Kind.NUMBER, Kind.STRING)
_INDEXED = re.compile(r"[^\[\]]*(\[\d+\])?")  # how brackets in a word are meant: point[0]


@dataclass(frozen=True)
class Property:
    """A property's name and values as they stand in the file."""

    name: Token
    values: tuple[Token, ...]


@dataclass
class Entity:
    """An entity: its type (macros resolved), the word that made it, properties and children in file order.

    All instances of a macro have its children in common.
    """

    type: str
    name: Token
    properties: dict[str, Property] = field(default_factory=dict)
    children: list[Entity] = field(default_factory=list)


@dataclass
class _Macro:
    base: Token
    start: int  # of its body among the tokens: behind the opening bracket
    template: Entity | None = None  # what it comes to
    known: int = 0  # how many macros were known when the template was made: a later one may change it


@dataclass(frozen=True)
class Macros:
    """What a file defines, and the tokens that it stands in."""

    tokens: tuple[Token, ...]
    known: Mapping[str, _Macro]


NO_MACROS = Macros((), {})


def parse(top: Path, values: Mapping[str, str], notes: Notes) -> tuple[Entity, Macros]:
    """Return the world entity of a file, parameters filled in, and its macros.

    Raise Error with the place of what does not parse.
    """
    tokens = Reader(top, values, notes).read()
    parser = _Parser(tokens, top, notes, {})
    return parser.world(0), Macros(tuple(tokens[:-1]), parser.macros)


def parse_more(text: SourceText, top: Path, macros: Macros, notes: Notes) -> Entity:
    """Return the world entity of a text that knows the macros of a file at top. Raise Error with the place."""
    tokens = Reader(top, {}, notes).read(text)
    known = {name: replace(macro, template=None) for name, macro in macros.known.items()}
    return _Parser([*macros.tokens, *tokens], top, notes, known).world(len(macros.tokens))


class _Parser:
    """All tokens, and the macros known so far. Methods take and return places among the tokens."""

    def __init__(self, tokens: list[Token], top: Path, notes: Notes, macros: dict[str, _Macro]) -> None:
        self._tokens = tokens
        self._notes = notes
        self.macros = macros
        self._steps = 0
        self._world = Entity("world", Token(Kind.WORD, "world", SourceText(top, tokens[-1].source.text), 0))

    def world(self, at: int) -> Entity:
        """Return the world entity of the tokens from a place on."""
        tokens = self._tokens
        while (token := tokens[at]).kind is not Kind.END:
            if token.kind is Kind.LINE_END:
                at += 1
            elif token.kind is not Kind.WORD:
                raise self._unexpected(at)
            elif token.text == "define":
                at = self._define(at)
            else:
                at = self._word(self._world, at, depth=0)
        return self._world

    def _define(self, at: int) -> int:
        define, parts = self._tokens[at], []
        for kind in (Kind.WORD, Kind.WORD, Kind.OPEN):
            at = self._after_line_ends(at + 1)
            if self._tokens[at].kind is not kind:
                raise self._tokens[at].error(f"define needs a name, a type and '(', not {self._tokens[at]}")
            parts.append(self._tokens[at])
        name, base, _ = parts
        if name.text not in self.macros:  # the first definition wins, as in Stage
            self.macros[name.text] = _Macro(base, at + 1)
        return self._closing(at, define) + 1

    def _closing(self, opening: int, define: Token) -> int:
        depth = 0
        for at in range(opening, len(self._tokens)):
            kind = self._tokens[at].kind
            depth += (kind is Kind.OPEN) - (kind is Kind.CLOSE)
            if depth == 0:
                return at
        raise self._tokens[opening].error(f"the '(' of {define.text} is never closed")

    def _count(self, word: Token, steps: int) -> None:
        """Count what is read. Raise Error if macros of macros come to too much."""
        self._steps += steps
        if self._steps > _MOST_STEPS:
            raise word.error(f"the macros come to more than {_MOST_STEPS} properties and entities")

    def _instance(self, base: Entity, word: Token) -> Entity:
        """Return a copy of what a macro comes to, to read more into."""
        self._count(word, len(base.properties) + len(base.children))
        return Entity(base.type, word, dict(base.properties), list(base.children))

    def _after_line_ends(self, at: int) -> int:
        while self._tokens[at].kind is Kind.LINE_END:
            at += 1
        return at

    def _word(self, entity: Entity, at: int, depth: int) -> int:
        """Read a property or a child of an entity."""
        self._count(entity.name, 1)
        word, following = self._tokens[at], self._after_line_ends(at + 1)
        kind = self._tokens[following].kind
        if kind is Kind.OPEN:
            return self._child(entity, word, following + 1, depth + 1)
        if word.text == "define" and kind is Kind.WORD:
            raise word.error("define is allowed at the top level only")
        if kind in _VALUES and following == at + 1:
            entity.properties[word.text] = Property(word, (self._tokens[following],))
            return following + 1
        if kind is Kind.OPEN_TUPLE and following == at + 1:
            return self._tuple(entity, word, following + 1)
        raise self._no_value(word, self._tokens[at + 1])

    def _unexpected(self, at: int) -> Exception:
        """Return the error of a token that begins nothing: a word before it on its line may have eaten a bracket."""
        token = self._tokens[at]
        while at > 0 and self._tokens[at - 1].kind not in (Kind.LINE_END, Kind.CLOSE, Kind.OPEN):
            at -= 1
            if self._tokens[at].kind is Kind.WORD and not _INDEXED.fullmatch(self._tokens[at].text):
                return self._no_blank(self._tokens[at])
        return token.error(f"expected a property or an entity, not {token}")

    def _no_blank(self, word: Token) -> Exception:
        ends = word.text.rfind("[")
        return word.source.error(word.at + ends, f"a blank is missing before '[': {word.text[:ends]} [...]")

    def _no_value(self, word: Token, found: Token) -> Exception:
        if not _INDEXED.fullmatch(word.text):
            return self._no_blank(word)
        before = word.source.text[word.at - 1 : word.at]
        if before.isdigit() and word.text[0] in "eE":
            return word.error(f"numbers have no exponent in Stage's language: {before}{word.text}")
        index = word.text[word.text.find("[") :] if word.text.endswith("]") else ""
        hint = f"; if {index} is its value, a blank is missing before it" if index else ""
        return word.error(f"{word.text} needs a value on its line, or '(', not {found}{hint}")

    def _child(self, parent: Entity, word: Token, at: int, depth: int) -> int:
        """Read an entity whose opening bracket is just behind."""
        if depth > _DEEPEST:
            raise word.error(f"more than {_DEEPEST} levels of entities")
        macro = self.macros.get(word.text)
        child = self._instance(self._template(macro, word, depth), word) if macro else Entity(word.text, word)
        parent.children.append(child)
        return self._body(child, at, depth)

    def _body(self, entity: Entity, at: int, depth: int) -> int:
        tokens = self._tokens
        while True:
            kind = tokens[at].kind
            if kind is Kind.LINE_END:
                at += 1
            elif kind is Kind.WORD:
                at = self._word(entity, at, depth)
            elif kind is Kind.CLOSE:
                return at + 1
            elif kind is Kind.OPEN:
                entity, at = self._second_bracket(entity, tokens[at]), at + 1
            elif kind is Kind.END:
                raise entity.name.error(f"the '(' of {entity.name.text} is never closed")
            else:
                raise self._unexpected(at)

    def _second_bracket(self, entity: Entity, bracket: Token) -> Entity:
        """Return the entity that a '(' without a name before it begins: as in Stage, another one of the same type.

        It ends at the same ')', and there is none if the type is a macro.
        """
        self._notes.add(bracket, "a '(' without a name: is that intended?")
        self._count(bracket, 1)
        if entity.name.text in self.macros:
            return entity
        entity.children.append(Entity(entity.name.text, entity.name))
        return entity.children[-1]

    def _template(self, macro: _Macro, word: Token, depth: int) -> Entity:
        """Return what a macro comes to, read once for all its instances."""
        if depth > _DEEPEST:
            raise macro.base.error(f"macro {word.text} never ends")
        if macro.template is None or macro.known != len(self.macros):
            known = self.macros.get(macro.base.text)
            name = macro.base
            template = (
                self._instance(self._template(known, word, depth + 1), name) if known else Entity(name.text, name)
            )
            self._body(template, macro.start, depth)
            macro.template, macro.known = template, len(self.macros)
        return macro.template

    def _tuple(self, entity: Entity, name: Token, at: int) -> int:
        values: list[Token] = []
        while (token := self._tokens[at]).kind in _VALUES:
            values.append(token)
            at += 1
        if token.kind not in (Kind.CLOSE_TUPLE, Kind.END):  # Stage too takes the end of the file for a bracket
            raise token.error(f"{name.text} needs a number or a string on its line, not {token}")
        entity.properties[name.text] = Property(name, tuple(values))
        return at + (token.kind is Kind.CLOSE_TUPLE)
