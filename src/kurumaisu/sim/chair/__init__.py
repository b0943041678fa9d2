# SPDX-License-Identifier: BSD-3-Clause
"""The simulated chair: voltages in, poses and scans out."""
