# SPDX-License-Identifier: BSD-3-Clause
"""What is in no catalogue: curves over what is known of a drive, weighed against the effects (curves.py)."""
