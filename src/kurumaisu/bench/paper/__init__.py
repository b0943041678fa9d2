# SPDX-License-Identifier: BSD-3-Clause
"""How often the intervals of equations (1), (2) and (4) hold the truth."""
