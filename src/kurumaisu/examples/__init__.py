# SPDX-License-Identifier: BSD-3-Clause
"""The simulator from Python alone, to read and to copy."""
