"""One file for each library, used as its own users would; each needs only that library, from the extra `bench`."""
