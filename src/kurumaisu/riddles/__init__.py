# SPDX-License-Identifier: BSD-3-Clause
"""Open questions of the paper as experiments: what a lab would measure under each answer, and what the critic says."""
