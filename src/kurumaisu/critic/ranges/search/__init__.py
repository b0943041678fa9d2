# SPDX-License-Identifier: BSD-3-Clause
"""Here it is decided which effects act on the mean readings (mean_effects.py): parameter_fit.py has their sizes."""
