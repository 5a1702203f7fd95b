"""One target after another: a spring that is set on the way, beside what does without."""
