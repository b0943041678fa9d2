# SPDX-License-Identifier: BSD-3-Clause
"""Robots made by people who have seen neither the critic nor the simulator: recordings with something hidden.

Each package has make(folder, kind, seed), which writes recording/, truth.json and answers.csv, or raises RuntimeError
where its author's draws come to no such case. scree (laboratories, warehouses) and loess (wheelchairs, hospitals)
are to report on, fell (mechanics) and quay (many robots and lasers) to develop on: once the cases of one have been
looked at, the next report needs another.
"""
