"""What every part of the runtime uses: errors, child processes, background writers, file locks, the kernel cache."""
