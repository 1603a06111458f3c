"""What a contract finds."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """Hold one point of a contract: its name, whether it holds, and what was seen."""

    name: str
    passed: bool
    sentence: str
