"""Make an SVG file a harmless part of a page: no script, no other file, ids of its own, fewer digits."""

import re
from xml.etree import ElementTree

from markupsafe import Markup

from armid.errors import ArmidError

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
NUMBER = re.compile(r"-?\d+\.\d+")
REFERENCE = re.compile(r"url\(\s*#([^)\s]+)\s*\)")
POINTS_PER_PIXEL = 0.75
# On a narrow screen a figure is made smaller down to this share of its size, from where on it scrolls.
LEAST_SIZE = 0.6
PICTURE = "data:image/png;base64,"


def inline(text: str, prefix: str, label: str, where: str = "a figure") -> Markup:
    """Return an SVG as part of a page.

    Elements and attributes that drawings do not need are left out, and so are references to anything outside.
    prefix: set before each id, so that several can stand on one page; label: read out in place of the picture; where:
    names it in an error.

    Raises ArmidError for what is no SVG.
    """
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ArmidError(f"{where} is no SVG ({error}): a file that armid wrote is expected") from error
    if local(root.tag) != "svg":
        raise ArmidError(f"{where} holds <{local(root.tag)}>, an SVG is expected")
    used = referenced(root)
    made = cleaned(root, prefix, used)
    made.attrib.pop("height", None)
    width = re.fullmatch(r"([\d.]+)pt", made.get("width", ""))
    made.attrib |= {"width": "100%", "role": "img", "aria-label": label}
    if width:
        pixels = float(width.group(1)) / POINTS_PER_PIXEL
        made.attrib |= {"width": f"{pixels:.0f}", "style": f"min-width: {LEAST_SIZE * pixels:.0f}px"}
    return Markup(ElementTree.tostring(made, encoding="unicode"))


def local(name: str) -> str:
    """Return the name of an element or attribute without its namespace."""
    return name.rpartition("}")[2]


def referenced(root: ElementTree.Element) -> set[str]:
    found: set[str] = set()
    for element in root.iter():
        for name, value in element.attrib.items():
            found |= set(REFERENCE.findall(value))
            if local(name) == "href" and value.startswith("#"):
                found.add(value[1:])
    return found


def cleaned(element: ElementTree.Element, prefix: str, used: set[str]) -> ElementTree.Element:
    name = local(element.tag)
    made = ElementTree.Element(name)
    for key, value in element.attrib.items():
        kept = allowed(local(key), value, name, prefix, used)
        if kept is not None:
            made.set(local(key), kept)
    if element.get("id") in LAYERS:
        made.set("class", f"layer-{element.get('id')}")
    if name in ("text", "tspan"):
        made.text = element.text
    for child in element:
        # comments have a function for a tag
        if isinstance(child.tag, str) and local(child.tag) in ELEMENTS:
            made.append(cleaned(child, prefix, used))
    return made


def allowed(key: str, value: str, element: str, prefix: str, used: set[str]) -> str | None:
    """Return an attribute as it may stand on the page, None for one that may not."""
    if key not in ATTRIBUTES or (key == "id" and value not in used):
        return None
    if key == "id":
        return prefix + value
    if key == "href":
        picture = element == "image" and value.startswith(PICTURE)
        return f"#{prefix}{value[1:]}" if value.startswith("#") else value if picture else None
    if "url(" in REFERENCE.sub("", value).lower():
        return None
    short = " ".join(NUMBER.sub(shorter, value).split()) if key in ROUNDED else value
    return REFERENCE.sub(rf"url(#{prefix}\1)", short)


def shorter(number: re.Match[str]) -> str:
    """Return a number with two digits after the point: a hundredth of a point is not seen."""
    return f"{float(number.group()):.2f}".rstrip("0").rstrip(".")
