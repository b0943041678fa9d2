# SPDX-License-Identifier: BSD-3-Clause
"""What passes between the rooms: recording, verdict, story; what is believed before the data (prior.py)."""
