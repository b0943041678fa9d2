# SPDX-License-Identifier: BSD-3-Clause
"""The base channel: a run's inputs and measured increments (drive.py), and the same run simulated (replay.py)."""
