# SPDX-License-Identifier: BSD-3-Clause
"""Laser criticism: what the scans say that map, reference poses and equation (4) do not."""
