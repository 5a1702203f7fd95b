"""Pictures as an mp4 film."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Final

import av
import numpy as np
from numpy.typing import NDArray

from chilopod.errors import OutputError

ENCODER: Final = "libx264"


def has_encoder() -> bool:
    """True if films can be encoded here."""
    try:
        av.codec.Codec(ENCODER, "w")
    except (av.FFmpegError, av.codec.codec.UnknownCodecError):
        return False
    return True


def encoded(frames: Iterator[NDArray[np.uint8]], fps: int, size: tuple[int, int]) -> bytes:
    """The bytes of an mp4 of frames of shape (height, width, 4); an OutputError if there is no room for it."""
    # Moving the index to the front takes a file: it is read again while it is written.
    try:
        with tempfile.TemporaryDirectory(prefix="chilopod-") as folder:
            file = Path(folder) / "movie.mp4"
            with av.open(str(file), "w", format="mp4", options={"movflags": "+faststart"}) as container:
                stream = container.add_stream(ENCODER, rate=Fraction(fps), options={"crf": "20", "preset": "veryfast"})
                stream.width, stream.height = size
                stream.pix_fmt = "yuv420p"
                stream.gop_size = 2 * fps  # so that a player finds any time within two seconds of film
                for pixels in frames:
                    container.mux(stream.encode(av.VideoFrame.from_ndarray(pixels, format="rgba")))
                container.mux(stream.encode())
            return file.read_bytes()
    except OutputError:  # of what draws the frames
        raise
    except OSError as error:
        raise OutputError(
            f"films cannot be encoded ({error.strerror or error})", source=tempfile.gettempdir()
        ) from None
