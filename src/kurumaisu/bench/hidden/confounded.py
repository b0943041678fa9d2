# SPDX-License-Identifier: BSD-3-Clause
"""Designs in which an id cannot be told from others: which drive hides which."""

from __future__ import annotations

# id hidden, design of the drives; the set that answers is worked out for each recording (Truth.accepted)
CONFOUNDED: tuple[tuple[str, str], ...] = (
    ("base.gain_v", "one_speed"),
    ("base.dead_zone_v", "one_speed"),
    ("base.curvature_v", "one_speed"),
    ("base.gain_w", "one_turn"),
    ("base.dac_zero_s", "one_turn"),
    ("base.gain_v", "constant"),
    ("base.gain_w", "constant"),
    ("base.veer", "constant"),
    ("base.lateral_slip", "constant"),
    ("base.cross_w_to_v", "rich"),
    ("base.marker_y", "rich"),
    ("laser.offset", "wall"),
    ("laser.mount_x", "wall"),
    ("world.map_error", "wall"),
    ("laser.scale", "wall"),
)
