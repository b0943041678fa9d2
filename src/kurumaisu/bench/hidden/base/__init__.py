# SPDX-License-Identifier: BSD-3-Clause
"""Faults hidden in the base."""
