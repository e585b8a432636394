"""The desk answers, and says so where something does not fit into its memory."""

import asyncio
import sys
from contextlib import closing

import pytest

from brightgrey.app.desk.process import Desk
from brightgrey.app.security.memory import MemoryPolicy, memory_allowed
from brightgrey.errors import RecordingError

pytestmark = pytest.mark.xdist_group("running app")  # before a browser, whose event loop stays
linux_only = pytest.mark.skipif(sys.platform != "linux", reason="only Linux bounds the memory of a process")


@linux_only
@pytest.mark.system
def test_desk__file_larger_than_its_memory__says_what_to_do_and_goes_on(tmp_path, monkeypatch):
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "1")  # whose threads would take memory, one for each core
    file = tmp_path / "large.csv"
    file.write_bytes(b"t,torque,velocity\n" + b"0.001,1,2\n" * 6_000_000)

    async def answers(desk):
        with pytest.raises(RecordingError, match=r"memory.*cut out the seconds that matter"):
            await desk.call("inspect_file", str(file))
        desk.recycle(file.stat().st_size)
        return await desk.call("effect_choices")

    with closing(Desk(memory=380 << 20)) as desk:
        assert asyncio.run(answers(desk))["effects"]


@linux_only
def test_memory_allowed__is_a_part_of_what_is_free_and_never_too_little():
    whole = memory_allowed(MemoryPolicy(share=1.0))
    assert memory_allowed(MemoryPolicy(share=0.25)) < whole
    assert memory_allowed(MemoryPolicy(share=0.0, least=5)) == 5
