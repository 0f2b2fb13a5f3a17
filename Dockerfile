# MyView in one image. Every process of a site is `myview` with another command: see docker-compose.yml.

# To build the same image again, name the base by its digest, or your own copy of it:
#   docker build --build-arg BASE=python:3.11-slim-bookworm@sha256:… -t myview .
ARG BASE=python:3.11-slim-bookworm

# Builds the wheel in a separate stage, so that sources and build tools are not in the image.
FROM ${BASE} AS wheel
WORKDIR /src
COPY . .
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /wheel .

FROM ${BASE} AS site

# Not root, as a number, so that Kubernetes can check it; the group `video` may open /dev/video*.
RUN useradd --uid 10001 --create-home --groups video myview

# What MyView leans on, in the locked versions and without the development tools. The wheels of av and
# opencv-python-headless bring their libraries, so that nothing comes from apt. The libraries' own tests are left
# out. This layer, nearly all of the image, is made anew only when one of the two files changes.
RUN --mount=type=bind,source=pyproject.toml,target=/src/pyproject.toml \
    --mount=type=bind,source=requirements/lock.txt,target=/src/lock.txt \
    python -c 'import sys, tomllib; \
        print(*tomllib.load(sys.stdin.buffer)["project"]["dependencies"], sep="\n")' \
        < /src/pyproject.toml > /tmp/dependencies.txt \
    && pip install --no-cache-dir --root-user-action ignore --disable-pip-version-check \
        --constraint /src/lock.txt --requirement /tmp/dependencies.txt \
    && rm /tmp/dependencies.txt \
    && find "$(python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')" \
        -type d -name tests -prune -exec rm -rf {} +

RUN --mount=type=bind,from=wheel,source=/wheel,target=/wheel \
    pip install --no-cache-dir --root-user-action ignore --disable-pip-version-check --no-deps /wheel/*.whl

# matplotlib (`myview render`) keeps its font list here; the root may be read-only.
ENV MPLCONFIGDIR=/tmp/matplotlib PYTHONUNBUFFERED=1
USER 10001
WORKDIR /site
LABEL org.opencontainers.image.title="MyView" \
    org.opencontainers.image.description="Pick a person; see them, live, from whichever camera sees them best." \
    org.opencontainers.image.licenses="Apache-2.0"
EXPOSE 8080
ENTRYPOINT ["myview"]
CMD ["--help"]

# The same with GStreamer's RTSP server, for the gateway: docker-compose.rtsp.yml. It runs on Debian's own Python.
FROM site AS rtsp
USER root
RUN apt-get update && apt-get install -y --no-install-recommends python3-gi gir1.2-gst-rtsp-server-1.0 \
    && rm -rf /var/lib/apt/lists/*
USER 10001
EXPOSE 8554

FROM site
