"""Settings of all tests."""

import os

from hypothesis import settings

# In CI the same examples every time, so that a submission is judged by its own changes; at a desk new ones each run.
# No deadlines: how long an example takes is the machine's affair.
settings.register_profile("desk", deadline=None)
settings.register_profile("ci", derandomize=True, deadline=None)
settings.load_profile("ci" if os.environ.get("CI") else "desk")
