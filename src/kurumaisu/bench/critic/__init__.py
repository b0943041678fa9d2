# SPDX-License-Identifier: BSD-3-Clause
"""How often the critic is right, and what it costs."""
