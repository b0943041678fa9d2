# SPDX-License-Identifier: BSD-3-Clause
"""Here it is decided which effects change how readings scatter, mixed pixels among them (statistics.py)."""
