# SPDX-License-Identifier: BSD-3-Clause
"""A copy of a model file with other values in it, comments and all: what a calibration writes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import yaml

from kurumaisu.bounded_files import MOST_TEXT, read_text
from kurumaisu.errors import Error
from kurumaisu.whole_files import write_whole

Key = tuple[str, ...]


class ModelFile:
    """The text of a model file, in which single values or whole blocks are replaced."""

    def __init__(self, path: Path) -> None:
        """Read it. Raise Error naming the file."""
        self._path = path
        self._text = read_text(path, MOST_TEXT)

    def replace(self, key: Key, value: str) -> None:
        """Put other text in a value's place; what stands behind it on the line stays. Raise Error for another key."""
        node = self._node(key)
        self._text = self._text[: node.start_mark.index] + value + self._text[_end(node) :]

    def replace_block(self, key: Key, lines: Sequence[str]) -> None:
        """Put lines in the place of a mapping's, indented as it was; comments inside it go with it."""
        node = self._node(key)
        line_end = self._text.find("\n", _end(node))
        self._text = self._text[: _end(node)] + (self._text[line_end:] if line_end >= 0 else "")
        self.replace(key, ("\n" + " " * node.start_mark.column).join(lines))
        self._drop_orphan_comment(key)

    def head(self, lines: Sequence[str]) -> None:
        """Put comments before everything else."""
        self._text = "".join(f"# {line}".rstrip() + "\n" for line in lines) + "\n" + self._text

    def write(self, path: Path) -> None:
        """Write the file. Raise Error naming it."""
        write_whole({path: self._text})

    def _drop_orphan_comment(self, key: Key) -> None:
        """Take away a comment beside the key, which spoke of the values that were there."""
        start = self._text.rfind("\n", 0, self._text.rfind(f"{key[-1]}:", 0, self._node(key).start_mark.index)) + 1
        end = self._text.index("\n", start)
        line = self._text[start:end]
        self._text = self._text[:start] + line.split("#")[0].rstrip() + self._text[end:]

    def _node(self, key: Key) -> yaml.Node:
        node: yaml.Node | None = yaml.compose(self._text)
        for depth, name in enumerate(key):
            pairs = node.value if isinstance(node, yaml.MappingNode) else []
            found = [value for word, value in pairs if word.value == name]
            if not found:
                raise Error(f"{self._path}: {'.'.join(key[: depth + 1])}: is missing")
            node = found[0]
        assert node is not None
        return node


def _end(node: yaml.Node) -> int:
    """Return where a value ends: a block's own mark is where the next key begins, beyond comments and empty lines."""
    if isinstance(node, yaml.MappingNode) and not node.flow_style and node.value:
        return _end(node.value[-1][1])
    return int(node.end_mark.index)
