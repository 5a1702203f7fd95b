"""Settings of all tests."""

import os

from hypothesis import settings

# In CI the same examples every time, so that a submission is judged by its own changes; at a desk new ones each run.
settings.register_profile("ci", derandomize=True, deadline=None)
if os.environ.get("CI"):
    settings.load_profile("ci")
