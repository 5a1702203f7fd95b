"""One target after another: the variable spring beside other strategies."""
