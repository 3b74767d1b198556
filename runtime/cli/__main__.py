"""The command `echolocate`, also as `python -m runtime.cli`: signals are handled before anything else is imported."""

from __future__ import annotations

from runtime.cli.first_signals import handle_first_signals


def main() -> None:
    """Run the command line and exit."""
    handle_first_signals()
    from runtime.cli.standard_streams import open_standard_streams

    open_standard_streams()
    from runtime.cli.app import main as run_app

    run_app()


if __name__ == "__main__":
    main()
