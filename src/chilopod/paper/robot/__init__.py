"""The whole robot in three dimensions."""
