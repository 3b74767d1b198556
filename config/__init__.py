"""What can be set: the schema of every setting, how files become settings, and the files that are shipped."""
