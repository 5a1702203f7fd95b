"""Films as tests see them."""

import io

import av
import numpy as np


def decoded(film, rate=None) -> np.ndarray:
    """All frames, (T, height, width, 3), of a film of some frames a second."""
    with av.open(io.BytesIO(film)) as container:
        (stream,) = container.streams.video
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
        assert rate is None or stream.average_rate == rate
        return np.stack([frame.to_ndarray(format="rgb24") for frame in container.decode(stream)])
