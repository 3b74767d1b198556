"""Free valleys between the obstacles around the robot: VFH+ (Ulrich & Borenstein 1998), and its look-ahead, VFH*."""
