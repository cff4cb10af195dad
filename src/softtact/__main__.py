"""`python -m softtact`: the command line, where the `softtact` command is not on the path."""

import sys

from softtact.cli import main

if __name__ == "__main__":
    sys.exit(main())
