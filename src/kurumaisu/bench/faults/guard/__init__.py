# SPDX-License-Identifier: BSD-3-Clause
"""The guard, when what drives through it ends badly."""
