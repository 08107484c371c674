"""The command line ``rose2-logs``: the only place that prints."""
