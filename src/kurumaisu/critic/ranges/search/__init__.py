# SPDX-License-Identifier: BSD-3-Clause
"""Here it is decided which effects act on the mean readings, and how large they are."""
