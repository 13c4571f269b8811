# docker build --target node -t stepdriver .     the installed node: docs/install.md
# docker build --target development .            what a contributor needs: .devcontainer

FROM debian:bookworm AS development
SHELL ["/bin/bash", "-o", "pipefail", "-c"]
ENV LANG=C.UTF-8
COPY scripts/packages.txt /usr/share/stepdriver/packages.txt
# hadolint ignore=DL3008,SC2046
RUN apt-get update \
  && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends ca-certificates gdb git sudo \
    $(grep -o '^[a-z][^ ]*' /usr/share/stepdriver/packages.txt) \
  && rm -rf /var/lib/apt/lists/* \
  && useradd --create-home --shell /bin/bash developer \
  && echo 'developer ALL=(ALL) NOPASSWD: ALL' >/etc/sudoers.d/developer
USER developer
WORKDIR /home/developer

FROM development AS packages
COPY --chown=developer . /home/developer/stepdriver
RUN stepdriver/scripts/package.sh

FROM debian:bookworm AS node
ENV LANG=C.UTF-8
COPY --from=packages /home/developer/stepdriver/build/packages/*.deb /tmp/packages/
# hadolint ignore=DL3008
RUN apt-get update \
  && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends \
    /tmp/packages/ros-stepdriver_*.deb /tmp/packages/python3-stepdriver_*.deb \
  && rm -rf /var/lib/apt/lists/* /tmp/packages \
  && useradd --create-home stepdriver
USER stepdriver
WORKDIR /home/stepdriver
# Interrupted, roslaunch ends its nodes in order: the motors are disabled.
STOPSIGNAL SIGINT
ENTRYPOINT ["roslaunch", "stepdriver", "axis.launch"]
