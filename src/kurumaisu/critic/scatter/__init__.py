# SPDX-License-Identifier: BSD-3-Clause
"""Here it is decided which effects change how readings scatter, by statistics of simulated and measured scans."""
