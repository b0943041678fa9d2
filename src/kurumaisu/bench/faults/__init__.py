# SPDX-License-Identifier: BSD-3-Clause
"""Faults that are really made, and what came of them: of the base, the guard, the laser and its bytes."""
