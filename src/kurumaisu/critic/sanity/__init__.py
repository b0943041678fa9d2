# SPDX-License-Identifier: BSD-3-Clause
"""Here it is decided whether data are wrong rather than surprising, and what would mend them (examination.py)."""
