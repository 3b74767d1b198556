"""The command `echolocate`, also as `python -m runtime.cli`: signals are handled before anything else is imported."""

from __future__ import annotations

from runtime.cli.start_signals import end_at_once


def main() -> None:
    """Run the command line and exit."""
    end_at_once()
    from runtime.cli.app import main as run_app

    run_app()


if __name__ == "__main__":
    main()
