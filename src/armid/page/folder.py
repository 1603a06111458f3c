"""The page of what a command has stored in a folder."""

from pathlib import Path

from armid.model import ArmidError
from armid.page.identify_page import FIGURES as IDENTIFY_FIGURES
from armid.page.identify_page import identify_page
from armid.page.loop_page import FIGURES as LOOP_FIGURES
from armid.page.loop_page import loop_page
from armid.page.page import Page
from armid.page.stored import IDENTIFICATION, LOOP, MADE_BY, details_in, drawings_in, read_json

PAGE = "report.html"
MAKERS = {LOOP: (loop_page, LOOP_FIGURES), IDENTIFICATION: (identify_page, IDENTIFY_FIGURES)}


def page_of_folder(folder: Path, result: str, name: str) -> Page:
    """Return the page of a closed loop or of an identification.

    folder: where the files are; result: which of them holds the result, see `result_in`; name: of the folder, in the
    command that makes the page again.

    Raises ArmidError for files that are not what the commands write.
    """
    make, figures = MAKERS[result]
    stored = read_json(folder / result, MADE_BY[result])
    details = details_in(folder, MADE_BY[result])
    svgs = drawings_in(folder, tuple(figures))
    try:
        return make(stored, details, svgs, f"armid report {name}")
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        raise ArmidError(
            f"{folder / result}, or details.json beside it, is not what `{MADE_BY[result]}` writes "
            f"({type(error).__name__}: {error}): a folder that it wrote is expected"
        ) from error
