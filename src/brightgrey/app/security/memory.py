"""Memory that a process of the app may take: a file that is too large ends with a sentence, and not with the machine.

Linux bounds the memory of a process. Windows and macOS do not, or not so: nothing is bounded there.
"""

from __future__ import annotations

import re
import sys
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

__all__ = ["MEMORY", "MemoryPolicy", "bound_memory", "memory_allowed", "memory_sentence"]


@dataclass(frozen=True)
class MemoryPolicy:
    """Bound on the memory of a process that reads recordings."""

    share: float = 0.5  #: Part of the memory that is free when the process starts.
    least: int = 3 << 29  #: Bytes that a process gets in any case; the libraries alone take a good part of it.


MEMORY = MemoryPolicy()


def memory_allowed(policy: MemoryPolicy = MEMORY) -> int | None:
    """Bytes that a new process may take; None where the system does not say what is free."""
    with suppress(OSError):
        found = re.search(r"^MemAvailable:\s+(\d+) kB", Path("/proc/meminfo").read_text(encoding="ascii"), re.MULTILINE)
        if found:
            return max(int(policy.share * 1024 * int(found.group(1))), policy.least)
    return None


def bound_memory(pid: int, most: int | None) -> None:
    """Let a process, and those that it starts, allocate `most` bytes each; 0 is this process."""
    if sys.platform == "linux" and most is not None:
        import resource

        with suppress(OSError):  # it may be over already
            resource.prlimit(pid, resource.RLIMIT_DATA, (most, most))


def memory_sentence() -> str:
    """Sentence for somebody whose file does not fit into what this process may take."""
    bound = "there is"
    if sys.platform == "linux":
        import resource

        most = resource.getrlimit(resource.RLIMIT_DATA)[0]
        bound = f"the {most / 1e9:.1f} GB that it may take here" if most > 0 else bound
    return (
        f"to read this file takes more memory than {bound}; cut out the seconds that matter, or keep every Nth sample, "
        "and take that file"
    )
