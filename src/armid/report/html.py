"""Turn a page into one HTML file that asks for nothing else."""

from base64 import b64encode
from hashlib import sha256

from armid.report.document import Page


def html(page: Page) -> str:
    """Return the page as HTML: style, script and figures are in it.

    Everything from files is escaped, and a browser runs no script but the page's own, whose hash the page names.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    places = PackageLoader("armid.report")
    environment = Environment(
        loader=places, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        keep_trailing_newline=True,
    )  # fmt: skip
    script, style = (places.get_source(environment, name)[0] for name in ("page.js", "page.css"))
    digest = b64encode(sha256(script.encode()).digest()).decode()
    return environment.get_template("page.html").render(page=page, script=script, style=style, digest=digest)
