# SPDX-License-Identifier: BSD-3-Clause
"""The verdict as one self-contained page, with its pictures."""
