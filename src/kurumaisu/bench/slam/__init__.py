# SPDX-License-Identifier: BSD-3-Clause
"""Mapping and localisation, next to gmapping and AMCL."""
