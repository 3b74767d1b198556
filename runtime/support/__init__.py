"""Services that all of runtime uses: log, health, background writer, child processes, locks, kernel cache."""
