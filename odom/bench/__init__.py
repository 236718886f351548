"""The benches: how accurate the odometry is, what it costs, and how much a spoilt source or another number harms it."""
