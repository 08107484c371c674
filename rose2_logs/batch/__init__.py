"""Many logs into one folder: by workers here or on a cluster; stopped, it can go on later."""
