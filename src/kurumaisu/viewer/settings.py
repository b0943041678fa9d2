# SPDX-License-Identifier: BSD-3-Clause
"""Settings of the viewer: launch/viewer.yaml."""

from __future__ import annotations

from dataclasses import dataclass

from kurumaisu.settings import Section


@dataclass(frozen=True)
class ViewerSettings:
    """How the server behaves; see launch/viewer.yaml for units and meaning."""

    host: str
    port: int
    names: tuple[str, ...]
    rate: float
    patience: float
    most_clients: int
    longest_message: int


def read_settings(top: Section) -> ViewerSettings:
    """Take the server's keys. Raise Error naming the key for anything wrong."""
    names = top.take("names")
    if not isinstance(names, list) or not all(isinstance(name, str) and name for name in names):
        raise top.error("names", f"must be a list of names: {names!r}")
    port = top.integer("port", at_least=0)
    highest = 65535
    if port > highest:
        raise top.error("port", f"must be 0 to {highest}: {port}")
    return ViewerSettings(
        host=top.text("host"),
        port=port,
        names=tuple(name.lower() for name in names),
        rate=top.number("rate", above=0),
        patience=top.number("patience", above=0),
        most_clients=top.integer("most_clients", at_least=1),
        longest_message=top.integer("longest_message", at_least=1),
    )
