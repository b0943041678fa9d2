# SPDX-License-Identifier: BSD-3-Clause
"""What the scans saw: where and when each beam was fired, which readings count, what the map does not have."""
