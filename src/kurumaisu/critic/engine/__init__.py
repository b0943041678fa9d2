# SPDX-License-Identifier: BSD-3-Clause
"""Which effects act on the drives, by a search over sets (search.py); the evidence of a set is in evidence.py."""
