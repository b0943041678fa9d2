# SPDX-License-Identifier: BSD-3-Clause
"""The faults of a laser and its wire, and what drivers make of them."""
