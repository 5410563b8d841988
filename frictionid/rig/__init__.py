"""Recording: the motor drive's log, signals played to it, and one clock for torque and angles."""
