# SPDX-License-Identifier: BSD-3-Clause
"""The search over sets of effects on the drives: fits, evidence, posterior, and what cannot be told apart."""
