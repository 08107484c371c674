"""Many logs into one folder of results: by workers on this machine or on a cluster; can be resumed."""
