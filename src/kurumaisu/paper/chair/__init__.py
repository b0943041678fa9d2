# SPDX-License-Identifier: BSD-3-Clause
"""Figures 3 to 6 and 10, equations (1) and (2): from a drive to the law of the chair."""
