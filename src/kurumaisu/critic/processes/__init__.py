# SPDX-License-Identifier: BSD-3-Clause
"""What runs in a process of its own: a worker, and the criticism of the scans in one."""
