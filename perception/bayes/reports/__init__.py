"""Results for those outside: objects, what explains an echo, and the evidence for an object."""
