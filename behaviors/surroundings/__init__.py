"""What lies around the robot, as schemas and arbiter ask: free ways, the view, what closes a way."""
