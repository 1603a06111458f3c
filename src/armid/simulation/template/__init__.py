"""The fixed part of the generated module: one step, the location of kinks inside it, the loop over samples."""

from armid.simulation.template.header import LONGEST
from armid.simulation.template.module import module_text
from armid.simulation.template.parts import Parts

__all__ = ["LONGEST", "Parts", "module_text"]
