"""One self-contained HTML page for each result: a study, a closed loop, an identification."""

from armid.page.folder import PAGE, page_of_folder
from armid.page.page import Page
from armid.page.render import html
from armid.page.stored import DETAILS, IDENTIFICATION, LOOP, STUDY, result_in

__all__ = ["DETAILS", "IDENTIFICATION", "LOOP", "PAGE", "STUDY", "Page", "html", "page_of_folder", "result_in"]
