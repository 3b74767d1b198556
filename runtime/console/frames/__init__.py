"""What the page is sent: session information once, then one frame after each cycle."""
