"""docs/console.png: the console's page after a drive between the paper's six drums.

`python -m tests.browser.console_picture` takes it on a machine that has nothing else to do. A picture of a run whose
cycles were late is not kept, as it would show the machine's load and not the program.
"""

from __future__ import annotations

import asyncio
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Final

from playwright.async_api import async_playwright

from tests.browser.conftest import ARGUMENTS
from tests.browser.open_page import DESKTOP, Opened
from tests.hil.running import running, start_url

PICTURE: Final = Path(__file__).parents[2] / "docs" / "console.png"
BACK_M: Final = 1.5
"""On its way back, this far from the start, the robot has passed all drums twice."""
WAIT_S: Final = 180.0
LATE_MAX: Final = 5
"""Late and missed cycles of a healthy run of a minute."""
SEEN: Final = (
    f"run.fresh && run.state.objects.length >= 6 && Math.abs(run.state.pose[2]) > 2 && run.state.pose[0] < {BACK_M}"
)


async def take(kept: Path) -> int:
    """Drive, save the picture if the run was healthy, and return its late and missed cycles."""
    program = shutil.which("chromium-headless-shell") or shutil.which("chromium")
    width, height = DESKTOP
    arguments = ("run", "--no-record", "--set", "console.port=0")
    with tempfile.TemporaryDirectory() as name, running(Path(name), "run", *arguments, fresh=True) as command:
        url = await asyncio.to_thread(start_url, command)
        async with async_playwright() as playwright:
            browser = await playwright.chromium.launch(executable_path=program, args=list(ARGUMENTS))
            context = await browser.new_context(viewport={"width": width, "height": height})
            await context.add_init_script("localStorage.setItem('echolocate', '{\"tour seen\": true}')")
            opened = Opened(await context.new_page(), lambda _: None, is_real_time=True)
            await opened.page.goto(url)
            end_s = asyncio.get_running_loop().time() + WAIT_S
            while not await opened.world(f"Boolean({SEEN})"):
                if asyncio.get_running_loop().time() > end_s:
                    sys.exit(f"console_picture: no six drums on the way back within {WAIT_S:g} s; {command.err}")
                await asyncio.sleep(0.1)
            late = int(await opened.world("run.state.late + run.state.missed"))
            picture = await opened.page.screenshot()
            await browser.close()
    if late <= LATE_MAX:
        kept.write_bytes(picture)
    return late


def main() -> None:
    """Take the picture; end with 1 if the machine was busy."""
    late = asyncio.run(take(PICTURE))
    if late > LATE_MAX:
        sys.exit(f"console_picture: {late} cycles late or missed, so the machine is busy: try again when it is idle")


if __name__ == "__main__":
    main()
