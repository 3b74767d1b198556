"""`echolocate run`: settings, the process, its recording, its console, and the runs beside it."""
