# SPDX-License-Identifier: BSD-3-Clause
"""The generator's own chair, laser and rooms, and what a case is."""
