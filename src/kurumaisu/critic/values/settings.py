# SPDX-License-Identifier: BSD-3-Clause
"""Effects with values, as a model file has them."""

from __future__ import annotations

from kurumaisu.params import EffectSetting

Settings = tuple[EffectSetting, ...]
