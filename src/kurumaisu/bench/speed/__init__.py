# SPDX-License-Identifier: BSD-3-Clause
"""What things cost: time, processor and memory, next to their peers."""
