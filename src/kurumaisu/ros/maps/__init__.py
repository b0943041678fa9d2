# SPDX-License-Identifier: BSD-3-Clause
"""map_server and map_saver."""
