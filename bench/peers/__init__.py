"""One module for each library, used as its documentation recommends; each needs only that library (extra `bench`)."""
