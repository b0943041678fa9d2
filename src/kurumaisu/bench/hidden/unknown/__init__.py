# SPDX-License-Identifier: BSD-3-Clause
"""Faults that are in no catalogue."""
