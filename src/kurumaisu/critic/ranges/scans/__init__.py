# SPDX-License-Identifier: BSD-3-Clause
"""What the scans saw, and which readings count: mixed pixels are left out of the mean in valid_readings.py."""
