# SPDX-License-Identifier: BSD-3-Clause
"""Which effects act, and which curves: sets that single effects propose (search.py), and how likely each is."""
