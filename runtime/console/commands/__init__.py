"""Commands of operators: the registry of the commands that a page may send, and their handlers."""
