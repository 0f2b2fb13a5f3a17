# MyView in one image. Every process of a site is `myview` with another command: see docker-compose.yml.

# To build the same image again, name the base by its digest, or your own copy of it:
#   docker build --build-arg BASE=python:3.11-slim-bookworm@sha256:… -t myview .
ARG BASE=python:3.11-slim-bookworm

# Builds the wheel in a separate stage, so that sources and build tools are not in the image.
FROM ${BASE} AS wheel
WORKDIR /src
COPY . .
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /wheel .

# What MyView leans on, in the locked versions and without the development tools, in an environment of its own. The
# wheels of av and opencv-python-headless bring their libraries, so that nothing comes from apt. Left out are the
# libraries' tests, sample data and sources; symbols stay, for `strip` breaks libraries that patchelf has changed. This
# layer, nearly all of the image, is made anew only when one of the two files changes.
FROM ${BASE} AS libraries
RUN --mount=type=bind,source=pyproject.toml,target=/src/pyproject.toml \
    --mount=type=bind,source=requirements/lock.txt,target=/src/lock.txt \
    python -m venv --without-pip /opt/myview \
    && python -c 'import sys, tomllib; \
        print(*tomllib.load(sys.stdin.buffer)["project"]["dependencies"], sep="\n")' \
        < /src/pyproject.toml > /tmp/dependencies.txt \
    && pip --python /opt/myview/bin/python install --no-cache-dir --disable-pip-version-check \
        --constraint /src/lock.txt --requirement /tmp/dependencies.txt \
    && cd /opt/myview/lib/python3.*/site-packages \
    && find . -type d \( -name tests -o -path ./numpy/_core/include \) -prune -exec rm -rf {} + \
    && find . -type f \( -path './cv2/data/*.xml' -o -name '*.a' -o -name '*.c' -o -name '*.h' -o -name '*.pxd' \
        -o -name '*.pyi' -o -name '*.pyx' \) -delete

# Lists what an image is made of (below); is in none.
FROM ${BASE} AS sbom
RUN --mount=type=bind,source=requirements/lock.txt,target=/src/lock.txt \
    python -m venv /sbom && /sbom/bin/pip install --no-cache-dir --disable-pip-version-check \
        --constraint /src/lock.txt cyclonedx-bom
COPY pyproject.toml /sbom/
COPY requirements /sbom/requirements

FROM ${BASE} AS site

# Not root, as a number, so that Kubernetes can check it; the group `video` may open /dev/video*.
RUN useradd --uid 10001 --create-home --groups video myview

COPY --from=libraries /opt/myview /opt/myview
ENV PATH=/opt/myview/bin:$PATH
RUN --mount=type=bind,from=wheel,source=/wheel,target=/wheel \
    pip --python /opt/myview/bin/python install --no-cache-dir --disable-pip-version-check --no-deps /wheel/*.whl

# The packages in the image with their versions and licenses: docs/how-to/containers.md.
RUN --mount=type=bind,from=sbom,source=/sbom,target=/sbom \
    /sbom/bin/python /sbom/requirements/sbom.py --image --python /opt/myview/bin/python \
        /usr/share/doc/myview/sbom.cdx.json

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

# The same with GStreamer's RTSP server, for the gateway: docker-compose.rtsp.yml. It runs on Debian's own Python. The
# empty package stands in for what Debian asks for and the gateway does not load: it would bring Mesa, LLVM, GTK and
# speech synthesis, 550 MB.
FROM site AS rtsp
USER root
RUN mkdir -p /tmp/empty/DEBIAN && printf '%s\n' 'Package: myview-unused-plugins' 'Version: 1' 'Architecture: all' \
        'Maintainer: MyView' 'Description: stands in for plugins of GStreamer that the gateway does not load' \
        'Provides: gstreamer1.0-plugins-bad (= 1.99), libgl1 (= 1.99)' > /tmp/empty/DEBIAN/control \
    && dpkg-deb --build /tmp/empty /tmp/empty.deb && apt-get update \
    && apt-get install -y --no-install-recommends /tmp/empty.deb python3-gi gir1.2-gst-rtsp-server-1.0 \
    && rm -rf /var/lib/apt/lists/* /tmp/empty /tmp/empty.deb
RUN --mount=type=bind,from=sbom,source=/sbom,target=/sbom \
    /sbom/bin/python /sbom/requirements/sbom.py --image --python /opt/myview/bin/python \
        /usr/share/doc/myview/sbom.cdx.json
USER 10001
EXPOSE 8554

FROM site
