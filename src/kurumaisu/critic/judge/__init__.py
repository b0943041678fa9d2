# SPDX-License-Identifier: BSD-3-Clause
"""Here a probability becomes a word: drive_verdict.py and explain.py for the drives, scan_verdict.py for the scans."""
