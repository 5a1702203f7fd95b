"""Walks as moving pictures, from above and in three dimensions: films and replays."""
