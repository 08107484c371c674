"""Results of ``analyze`` and ``batch`` read back from their folders."""
