# SPDX-License-Identifier: BSD-3-Clause
"""What passes between the rooms: recording, verdict, story. The prior of an effect is in prior.py."""
