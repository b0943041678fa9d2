# SPDX-License-Identifier: BSD-3-Clause
"""The critic: what a model gets wrong about a measured robot. pipeline.py tells the story."""
