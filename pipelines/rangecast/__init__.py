# SPDX-License-Identifier: LGPL-2.1-or-later
"""The program rangecast: each subcommand builds a launch string and runs it. Standard library only."""

__version__ = "0.1.0"
