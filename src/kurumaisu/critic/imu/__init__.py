# SPDX-License-Identifier: BSD-3-Clause
"""The rate at which a robot turned, by an inertial sensor mounted somehow."""
