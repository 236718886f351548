"""How far a recording may be spoilt before an odometry fails, and whether it says so: axes, levels, verdicts."""
