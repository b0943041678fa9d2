# SPDX-License-Identifier: BSD-3-Clause
"""The range channel: what the scans say that map, reference poses and equation (4) do not."""
