"""``python -m rose2_logs`` is the same as ``rose2-logs``."""

from rose2_logs.cli.main import main

if __name__ == "__main__":
    main()
