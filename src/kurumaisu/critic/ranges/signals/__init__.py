# SPDX-License-Identifier: BSD-3-Clause
"""What an effect, or a curve, does to the mean readings: the columns of the search."""
