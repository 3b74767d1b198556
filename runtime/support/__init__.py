"""What all of runtime uses: log, health, background writer, child processes, file locks, the kernel cache."""
