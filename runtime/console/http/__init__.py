"""The HTTP server of the console: static files, websockets, authentication, limits."""
