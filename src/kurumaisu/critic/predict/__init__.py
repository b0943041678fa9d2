# SPDX-License-Identifier: BSD-3-Clause
"""What a test run will measure, motion and scans, each with its standard deviation."""
