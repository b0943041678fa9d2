# SPDX-License-Identifier: BSD-3-Clause
"""The whole idea in five minutes: a drive and its map, a hidden effect found, a real wheelchair criticised."""
