"""SQLite databases of ROS 2 bags."""
