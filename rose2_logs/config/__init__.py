"""Every number and choice that a result depends on."""
