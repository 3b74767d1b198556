"""What the page is sent: session information at first, then one frame after each cycle."""
