"""Turn a document into one HTML file that asks for nothing else; SVG files become harmless parts of it."""

import re
from base64 import b64encode
from collections.abc import Mapping
from hashlib import sha256
from typing import Any
from xml.etree import ElementTree

from markupsafe import Markup

from armid.errors import ArmidError
from armid.report.document import Document, Figure, Table, varying
from armid.report.style import svg_text
from armid.units import angles_in


def html(document: Document, stored: Mapping[str, str] | None = None) -> str:
    """Return the document as HTML: style, script and figures are in it.

    Everything from files is escaped, and a browser runs no script but the page's own, whose hash the page names.
    stored: name of a figure -> its SVG; others are drawn.
    """

    def picture(figure: Figure) -> Markup:
        """Return a figure as part of the page, its ids made its own by its name."""
        text = (stored or {}).get(figure.name) or figure.svg or svg_text(figure.draw())
        return inline(text, f"{figure.name}-", figure.title, figure.title)

    environment = templates()
    environment.globals["picture"] = picture
    first = next(iter(document.tables), None)
    # evidence near the answer: figures stand before tables; the first table alone is open
    sections = [(s, sorted(s.parts, key=lambda part: isinstance(part, Table) and part is not first))
                for s in document.sections]  # fmt: skip
    script, style = (environment.loader.get_source(environment, name)[0] for name in ("page.js", "page.css"))
    digest = b64encode(sha256(script.encode()).digest()).decode()
    page = environment.get_template("page.html")
    given = {"page": document, "sections": sections, "first": first, "script": script, "style": style}
    with angles_in(document.angle):
        return str(page.render(**given, digest=digest))


def fragment(document: Document) -> str:
    """Return the answer and the first table of a document as HTML, for a notebook, where no script sorts."""
    parts: Any = templates().get_template("parts.html").module
    said = Markup("").join(Markup("<p>{}</p>").format(sentence) for sentence in document.said)
    return str(said + Markup("").join(parts.of(table, "", True, True) for table in document.main_tables[:1]))


def templates() -> Any:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    made = Environment(
        loader=PackageLoader("armid.report"), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True, keep_trailing_newline=True,
    )  # fmt: skip
    made.globals["varying"] = varying
    return made


ELEMENTS = frozenset(
    ("svg", "g", "defs", "path", "use", "clipPath", "rect", "circle", "ellipse", "line", "polyline", "polygon", "text",
     "tspan", "image", "linearGradient", "stop")
)  # fmt: skip
ATTRIBUTES = frozenset(
    ("id", "d", "x", "y", "x1", "x2", "y1", "y2", "cx", "cy", "r", "rx", "ry", "width", "height", "points", "transform",
     "style", "viewBox", "clip-path", "offset", "preserveAspectRatio", "gradientUnits", "href")
)  # fmt: skip
# Groups that a slider fades in and out.
LAYERS = ("before", "after")
ROUNDED = ("d", "points", "x", "y")
HTML_NUMBER = re.compile(r"-?\d+\.\d+")
REFERENCE = re.compile(r"url\(\s*#([^)\s]+)\s*\)")
POINTS_PER_PIXEL = 0.75
PICTURE = "data:image/png;base64,"


def inline(text: str, prefix: str, label: str, where: str = "a figure") -> Markup:
    """Return an SVG as part of a page; refuse anything else.

    Elements and attributes that drawings do not need are left out, and so are references to anything outside. prefix:
    set before each id, so that several can stand on one page; label: read out in place of the picture.
    """
    try:
        root = ElementTree.fromstring(text)
        if local(root.tag) != "svg":
            raise ArmidError(f"{where} holds <{local(root.tag)}>, an SVG is expected")
        made = cleaned(root, prefix)
        made.attrib.pop("height", None)
        width = re.fullmatch(r"([\d.]+)pt", made.get("width", ""))
        made.attrib |= {"width": "100%", "role": "img", "aria-label": label}
        if width:
            made.attrib["width"] = f"{float(width.group(1)) / POINTS_PER_PIXEL:.0f}"
        return Markup(ElementTree.tostring(made, encoding="unicode"))
    except (ElementTree.ParseError, RecursionError) as error:
        raise ArmidError(f"{where} is not an SVG, it was damaged: a file that armid wrote is expected") from error


def local(name: str) -> str:
    return name.rpartition("}")[2]


def cleaned(element: ElementTree.Element, prefix: str) -> ElementTree.Element:
    name = local(element.tag)
    made = ElementTree.Element(name)
    for key, value in element.attrib.items():
        kept = allowed(local(key), value, name, prefix)
        if kept is not None:
            made.set(local(key), kept)
    if element.get("id") in LAYERS:
        made.set("class", f"layer-{element.get('id')}")
    if name in ("text", "tspan"):
        made.text = element.text
    for child in element:
        # comments have a function for a tag
        if isinstance(child.tag, str) and local(child.tag) in ELEMENTS:
            made.append(cleaned(child, prefix))
    return made


def allowed(key: str, value: str, element: str, prefix: str) -> str | None:
    """Return an attribute as it may stand on the page, None for one that may not."""
    if key not in ATTRIBUTES:
        return None
    if key == "id":
        return prefix + value
    if key == "href":
        picture = element == "image" and value.startswith(PICTURE)
        return f"#{prefix}{value[1:]}" if value.startswith("#") else value if picture else None
    if "url(" in REFERENCE.sub("", value).lower():
        return None
    short = " ".join(HTML_NUMBER.sub(shorter, value).split()) if key in ROUNDED else value
    return REFERENCE.sub(rf"url(#{prefix}\1)", short)


def shorter(number: re.Match[str]) -> str:
    """Return a number with two digits after the point: a hundredth of a point is not seen."""
    return f"{float(number.group()):.2f}".rstrip("0").rstrip(".")
