"""What was measured: campaigns of records, their noise and the windows that count.

In reading order:
campaign  `read_campaign`: campaign.toml and its CSV files -> Campaign; the same of tables; `write_campaign`
schema    the kinds of values in a TOML file, and the shape of campaign.toml
reader    one [[records]] entry and its table -> Record; a measured column -> Signal: rows that are data, noise, turns
table     CSV files of numbers or tables of pandas, and what their headers mean
resample  even time grids out of the times of a file; which samples count
start     the state from which a record or a piece of it is simulated
dialect   CSV files with other separators, decimals, comments, units, encodings
sensor    what a sensor does: step, hold, noise; samples that are no data: clipped, repeated, wild ones
record    Record (one file), its Signals, its Pieces, Irregularity: what all of that is put into
"""

from armid.record.campaign import Campaign, read_campaign, write_campaign
from armid.record.record import Irregularity, Piece, Record, RecordWarning, Signal
from armid.record.resample import IrregularSamplingWarning
from armid.record.schema import Override
from armid.record.sensor import Noise
from armid.record.table import write_table

__all__ = [
    "Campaign", "IrregularSamplingWarning", "Irregularity", "Noise", "Override", "Piece", "Record", "RecordWarning",
    "Signal", "read_campaign", "write_campaign", "write_table",
]  # fmt: skip
