# SPDX-License-Identifier: BSD-3-Clause
"""Stage world files: text to entities (tokens, syntax) to walls and start poses (shapes, world)."""

from kurumaisu.world.world import Start, World, load_world

__all__ = ["Start", "World", "load_world"]
