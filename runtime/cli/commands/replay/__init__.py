"""`echolocate replay`: of a recording, and of a ring log."""
