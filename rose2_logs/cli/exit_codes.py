"""Exit codes of ``rose2-logs``, and what its help tells of them."""

from __future__ import annotations

EXIT_FAULT, EXIT_KNOWN, EXIT_INTERRUPTED = 1, 2, 130
EXIT_SIGNALED = 128
"""Plus the number of the signal, as shells have it."""
EXIT_CODES = (
    "[bold]Exit codes:[/bold] 0 done, also with warnings, which summary.json counts; 1 internal error of "
    "rose2-logs; 2 a log, a file or an option cannot be used, or there was a warning with --strict, and one "
    "line says which; 130 interrupted, 143 ended by TERM, 129 by HUP."
)
