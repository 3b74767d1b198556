"""The keys that only one family of robots has."""
