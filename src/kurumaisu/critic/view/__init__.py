# SPDX-License-Identifier: BSD-3-Clause
"""Recordings in the browser, moment by moment, beside the simulated drive."""
