"""Beyond pyproject.toml: what lies in ``build`` from before is not handed out, and a build knows its commit."""

import runpy
import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py


class Build(build_py):
    """Builds into an empty folder."""

    def run(self) -> None:
        """As of the class above, which would leave what it finds there."""
        if not self.editable_mode:
            shutil.rmtree(self.build_lib, ignore_errors=True)
        super().run()
        checkout = runpy.run_path("src/chilopod/sources.py")["checkout"]()
        if checkout and not self.editable_mode:
            Path(self.build_lib, "chilopod", "checkout.txt").write_text(checkout, encoding="utf-8")


setup(cmdclass={"build_py": Build})
