"""A self-contained HTML page about a run: tables, figures, statistics and settings."""
