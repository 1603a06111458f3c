"""Multiple shooting: fit records that are cut into short pieces, then pieces twice as long, up to the whole records.

Over a long time a wrong model leaves the measured motion, and its error has many minima; over a short one it has few.
Each piece starts from the state that the outputs show at its first sample, and its start is fitted (van Domselaar,
Hemker 1975, Nonlinear parameter estimation in initial value problems, NW 18/75; Bock 1983,
doi:10.1007/978-3-642-46471-8_6).
"""

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise

from armid.inference.library import Library
from armid.inference.model import Fit, accurate, fit_from, start_of, with_own_starts
from armid.model import Plant
from armid.problem.problem import by_record
from armid.record import Piece, Record
from armid.record.start import state_shown, track_of

# Pieces into which each piece of a record is cut, a power of two, and samples that one must have.
MOST_PARTS, FEWEST_OF_PART = 16, 100
# Samples of all records that are looked at in short pieces: of more than these only some pieces of each record are.
SAMPLES_IN_PIECES = 5_000
# File and sample of the record at which a piece begins -> the constants of its start, SI.
Starts = Mapping[tuple[str, int], Mapping[str, float]]


def on_short_pieces(library: Library, declared: Fit) -> tuple[Library, Fit] | None:
    """Return the library whose records are cut into short pieces, and the declared model fitted to these.

    None where the records are too short, or where no measured state tells how a piece starts.
    """
    n_parts = parts_of(library)
    if n_parts == 1:
        return None
    every = min(-(-len(library.data.sound) // SAMPLES_IN_PIECES), n_parts)
    short = cut_library(library, n_parts, {}, every)
    return short, accurate(fit_from(short.problem((), declared.values), (), [declared.z]), short)


def on_whole_records(fit: Fit, library: Library) -> Fit:
    """Return a fit to short pieces carried on to pieces twice as long, and at last to the records as they are.

    Its constants within tolerances are as declared. Each longer piece starts as the first of its two parts did.
    """
    n_parts, fit = parts_of(library), with_own_starts(replace(fit, others=(), base=None))
    while n_parts > 1:
        n_parts //= 2
        longer = cut_library(library, n_parts, starts_of(fit))
        problem = longer.problem(fit.active, fit.values)
        fit = with_own_starts(fit_from(problem, fit.active, [start_of(problem, fit.values)]))
    return fit


def parts_of(library: Library) -> int:
    """Return into how many parts each piece of the records can be cut."""
    plant, records = library.declared.plant, library.data.records
    if plant.records_one_speed or {s.name for s in plant.states} != plant.start_constants.keys():
        return 1
    shortest, n_parts = min(n for r in records for n in r.lengths), MOST_PARTS
    while n_parts > 1 and shortest < n_parts * FEWEST_OF_PART:
        n_parts //= 2
    return n_parts


def cut_library(library: Library, n_parts: int, starts: Starts, every: int = 1) -> Library:
    """Return the library with the same records in parts, whose starts are those that are known.

    Parts take their inputs as read; the whole records are those of the library. every: 2 keeps each second part, from
    one record to the next another one.
    """
    plant, data = library.declared.plant, library.data
    if n_parts > 1:
        data = library.as_read or data
        cut_records = (cut(r, n_parts, plant, i % every, every) for i, r in enumerate(data.records))
        data = replace(data, records=tuple(cut_records)).with_levels(data.levels)
    records = tuple(restarted(record, starts) for record in data.records)
    as_read = library.as_read if n_parts == 1 else None
    return replace(library.with_data(replace(data, records=records), as_read), _schedules={})


def cut(record: Record, n_parts: int, plant: Plant, first_part: int, every: int) -> Record:
    """Return the record with each of its pieces cut into parts that start anew, without what no window holds.

    Of the parts the first that is kept and each that follows it by so many.
    """
    asked = plant.start_constants.values()
    given = {name: value for name, value in record.constants.items() if name not in asked}
    tracks = {signal.output: track_of(signal) for signal in record.signals}
    whole, pieces = replace(record.manoeuvre, constants=given), list[Piece]()
    for piece in record.pieces:
        first, length = piece.start_index + piece.window.start, piece.window.stop - piece.window.start
        edges = [first + length * i // n_parts for i in range(n_parts + 1)]
        for a, b in list(pairwise(edges))[first_part::every]:
            inputs = [u[a:] for u in whole.inputs.values()]
            state, deviations = state_shown(plant, given, tracks, whole.interval, a, inputs)
            pieces.append(Piece(whole.part(a, b - a, state), slice(0, b - a), a, deviations, shown_start=state))
    return replace(record, pieces=tuple(pieces), whole_pieces=tuple(pieces))


def starts_of(fit: Fit) -> Starts:
    return {(ready.record.file, piece.start_index + piece.window.start): piece.manoeuvre.constants
            for ready in by_record(fit.records.replays) for piece in ready.record.pieces}  # fmt: skip


def restarted(record: Record, starts: Starts) -> Record:
    """Return the record whose pieces begin at known starts, where these are fitted."""

    def known(piece: Piece) -> Piece:
        there = starts.get((record.file, piece.start_index + piece.window.start))
        return piece if there is None else piece.with_constants({n: there[n] for n in piece.shown_start})

    return record.with_pieces(known)
