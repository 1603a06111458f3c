"""Write the page of a result beside its files."""

from pathlib import Path

from armid.cli.new_files import NewFiles


def write_page(files: NewFiles, result: str, folder: Path) -> None:
    """Write report.html from files that are about to be moved into a folder; result: the one that holds the result."""
    from armid.page import PAGE, html, page_of_folder  # noqa: PLC0415 - jinja2, and only what writes a page needs it

    text = html(page_of_folder(files.place, result, str(folder)))
    files.path(PAGE).write_text(text, encoding="utf-8")
