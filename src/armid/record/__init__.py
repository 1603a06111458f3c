"""What was measured: campaigns, their records, noise and windows."""

from armid.record.campaign import Campaign, read_campaign
from armid.record.record import Irregularity, Noise, Piece, Record
from armid.record.resample import IrregularSamplingWarning
from armid.record.schema import Override
from armid.record.writer import write_campaign, write_table

__all__ = [
    "Campaign", "IrregularSamplingWarning", "Irregularity", "Noise", "Override", "Piece", "Record", "read_campaign",
    "write_campaign", "write_table",
]  # fmt: skip
