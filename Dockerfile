# chilopod with its live page, its Gymnasium environments and clusters. Not built where chilopod's tests run.
#
#   docker build -t chilopod .
#   docker run --rm -v "$PWD:/work" chilopod walk aoi2022-planar --duration "60 s" --out walks.nc
#   docker run --rm -p 127.0.0.1:8080:8080 chilopod live --host 0.0.0.0
#
# Results belong to user 1000; where you are another, add: --user "$(id -u):$(id -g)"

FROM python:3.13-slim AS base
# Mesa draws films and stills in 3-D, without a graphics card or a display.
RUN apt-get update \
 && apt-get install --yes --no-install-recommends libegl1 libgl1 libgl1-mesa-dri \
 && rm -rf /var/lib/apt/lists/*
RUN useradd --create-home --uid 1000 chilopod

# For the development container: what a checkout takes beside Python, and the browser that its tests drive.
FROM base AS develop
RUN apt-get update \
 && apt-get install --yes --no-install-recommends chromium git make \
 && rm -rf /var/lib/apt/lists/*
USER chilopod

FROM base AS built
WORKDIR /source
COPY LICENSE README.md pyproject.toml requirements.lock setup.py ./
COPY src src
RUN python -m venv /opt/chilopod \
 && /opt/chilopod/bin/pip install --no-cache-dir --constraint requirements.lock ".[cluster,gym,live]"

FROM base
COPY --from=built /opt/chilopod /opt/chilopod
# Whoever runs it may write here: compiled code, and what matplotlib remembers of fonts.
ENV PATH=/opt/chilopod/bin:$PATH \
    NUMBA_CACHE_DIR=/var/cache/chilopod/numba \
    MPLCONFIGDIR=/var/cache/chilopod/matplotlib
RUN mkdir --parents --mode 1777 /work /var/cache/chilopod "$NUMBA_CACHE_DIR" "$MPLCONFIGDIR"
USER chilopod
WORKDIR /work
# Compiles for the processor it is built on; another one compiles anew, once a container.
RUN chilopod turn aoi2022-planar --target "45 deg, 1.3 m" --out /tmp/turn \
 && rm -r /tmp/turn \
 && chmod --recursive a+rwX /var/cache/chilopod
EXPOSE 8080
ENTRYPOINT ["chilopod"]
CMD ["--help"]
