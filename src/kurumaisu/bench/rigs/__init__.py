# SPDX-License-Identifier: BSD-3-Clause
"""What benchmarks set up: a guard with its board and client, laser drivers with their sensors."""
