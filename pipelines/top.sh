#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The statistics of all hosts, live in a terminal.
exec python3 "$(dirname "$0")/top.py" "$@"
