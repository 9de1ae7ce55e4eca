"""`python -m hamotor`: the command line."""

from __future__ import annotations

import sys

from hamotor.cli import main

if __name__ == "__main__":
    sys.exit(main())
