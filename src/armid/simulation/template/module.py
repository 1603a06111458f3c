"""The whole text of a generated module."""

from armid.simulation.template.header import header_text
from armid.simulation.template.locate import locate_text
from armid.simulation.template.loop import loop_text
from armid.simulation.template.parts import Parts
from armid.simulation.template.step import step_text


def module_text(parts: Parts, equations: str, width: int) -> str:
    """Return the self-contained text that simulates a model.

    equations: the functions `fixed_values`, `start_values`, `rates`, `guards` and `recorded`, with what they call.
    """
    locate = "\n" + locate_text(parts) if parts.all_guards else ""
    return header_text(width) + equations + step_text(parts) + locate + "\n" + loop_text(parts)
