"""The command line: the application, its commands, and the live terminal view."""
