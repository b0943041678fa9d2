# SPDX-License-Identifier: BSD-3-Clause
"""Whether robots see and go the same in our simulator and in Stage."""
