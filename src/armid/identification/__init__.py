"""Parameters from records: one run, its result and its figures."""

from armid.identification.errors import Errors, campaign_errors, record_errors
from armid.identification.identify import INTERRUPTED, Identification, identify

__all__ = ["INTERRUPTED", "Errors", "Identification", "campaign_errors", "identify", "record_errors"]
