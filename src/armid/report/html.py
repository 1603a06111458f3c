"""Turn a document into one HTML file that asks for nothing else."""

from base64 import b64encode
from collections.abc import Mapping
from hashlib import sha256

from markupsafe import Markup

from armid.report.document import Document, Figure
from armid.report.style import svg_text
from armid.report.svg import inline


def html(document: Document, stored: Mapping[str, str] | None = None) -> str:
    """Return the document as HTML: style, script and figures are in it.

    Everything from files is escaped, and a browser runs no script but the page's own, whose hash the page names.
    stored: name of a figure -> its SVG; others are drawn.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    def picture(figure: Figure) -> Markup:
        """Return a figure as part of the page, its ids made its own by its name."""
        text = (stored or {}).get(figure.name) or figure.svg or svg_text(figure.draw() if figure.draw else None)
        return inline(text, f"{figure.name}-", figure.title, figure.title)

    places = PackageLoader("armid.report")
    environment = Environment(
        loader=places, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        keep_trailing_newline=True,
    )  # fmt: skip
    environment.globals["picture"] = picture
    script, style = (places.get_source(environment, name)[0] for name in ("page.js", "page.css"))
    digest = b64encode(sha256(script.encode()).digest()).decode()
    return environment.get_template("page.html").render(page=document, script=script, style=style, digest=digest)
