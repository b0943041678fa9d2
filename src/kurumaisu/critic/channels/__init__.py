# SPDX-License-Identifier: BSD-3-Clause
"""What is compared with the model: the base's increments, the mean of readings, and how readings scatter."""
