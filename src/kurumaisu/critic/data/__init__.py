# SPDX-License-Identifier: BSD-3-Clause
"""Recordings are read here: bags, CSV tables and rawlogs become runs; what is broken is mended or refused, in words."""
