"""Commented starting files for things of one's own."""

from armid.new.campaign import campaign_text, synthetic_records
from armid.new.start import KINDS, check_new_name, python_file

__all__ = ["KINDS", "campaign_text", "check_new_name", "python_file", "synthetic_records"]
