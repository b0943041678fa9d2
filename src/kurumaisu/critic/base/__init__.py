# SPDX-License-Identifier: BSD-3-Clause
"""The base channel: measured increments of the pose, and the same run simulated."""
