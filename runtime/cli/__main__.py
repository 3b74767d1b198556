"""`python -m runtime.cli`: the command `echolocate`, also where it is not installed."""

from __future__ import annotations

from runtime.cli.app import main

if __name__ == "__main__":
    main()
