# One image for every process: docker build -t rgbd-odom . && docker run --rm rgbd-odom run --headless
FROM python:3.12-slim-bookworm

# libopenni2-0: Kinect-like sensors; libusb comes with it
RUN apt-get update \
    && apt-get install -y --no-install-recommends libopenni2-0 \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --create-home --uid 1000 --groups video,plugdev odom \
    && install -d -o odom -g odom /data

WORKDIR /opt/rgbd-odom
COPY pyproject.toml README.md LICENSE ./
COPY odom odom
COPY sensors sensors
RUN pip install --no-cache-dir '.[kinect]'
COPY recordings recordings

USER odom
WORKDIR /data
# compile once, here, instead of at the first start of each container
ENV NUMBA_CACHE_DIR=/home/odom/.cache/numba
RUN odom doctor --help >/dev/null \
    && python -c "from odom.service.startup import warm_up; from odom.backend import OdometrySettings; from odom.wire import Topics; warm_up(OdometrySettings(), Topics()).wait()"

STOPSIGNAL SIGTERM
ENTRYPOINT ["odom"]
CMD ["run", "--headless", "--out", "/data/run"]
