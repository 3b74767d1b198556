"""The commands of `echolocate`, one module each: options in, exit code out."""
