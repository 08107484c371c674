"""A simulated building, a robot that explores it, and the maps that it makes: for developers only."""
