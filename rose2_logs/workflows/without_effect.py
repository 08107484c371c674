"""Tells of parameters that were set in vain."""

from __future__ import annotations

import logging

from rose2_logs.config.baselines import METHODS
from rose2_logs.config.parameters import Parameters
from rose2_logs.system.warnings import log_warning

logger = logging.getLogger(__name__)


def tell_without_effect(parameters: Parameters, method: str) -> None:
    """Warn of each parameter that was set, but that the chosen grouping does not ask for."""
    if method == METHODS[0]:
        for text in parameters.without_effect():
            log_warning(logger, "no_effect", text)
