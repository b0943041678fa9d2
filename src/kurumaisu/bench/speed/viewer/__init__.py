# SPDX-License-Identifier: BSD-3-Clause
"""What the viewer costs a simulator."""
