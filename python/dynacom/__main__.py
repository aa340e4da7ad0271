# SPDX-License-Identifier: BSD-2-Clause
"""``python -m dynacom``: the command line."""

from dynacom.cli import main

main()
