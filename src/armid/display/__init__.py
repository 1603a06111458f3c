"""How numbers and figures are shown to people."""

from armid.display.saving import save
from armid.display.style import GREY, OKABE_ITO, style
from armid.display.thin import thinned
from armid.display.units import SHOWN, shown

__all__ = ["GREY", "OKABE_ITO", "SHOWN", "save", "shown", "style", "thinned"]
