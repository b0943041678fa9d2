# SPDX-License-Identifier: BSD-3-Clause
"""Stage world files: text to entities (tokens, syntax) to walls and start poses (shapes, world)."""

from kurumaisu.world.snippet import Snippet, read_snippet
from kurumaisu.world.world import Start, World, load_world

__all__ = ["Snippet", "Start", "World", "load_world", "read_snippet"]
