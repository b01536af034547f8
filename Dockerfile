# docker build -t burg-drake .
# docker run --rm -v "$PWD:/work" --user "$(id -u):$(id -g)" burg-drake demo -n 10
# Pages of the setup, the lab and the camera are reachable on the ports given to docker run:
# docker run --rm -it -v "$PWD:/work" --user "$(id -u):$(id -g)" -p 8080:8080 burg-drake \
#     setup scene.yaml --host 0.0.0.0 --port 8080
# Meshcat listens on the container's own address alone: write pages with --html, or add --network host.
FROM python:3.13-slim-trixie AS build
WORKDIR /source
COPY . .
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /wheels .

FROM python:3.13-slim-trixie
COPY --from=build /wheels /wheels
# hadolint ignore=DL3013
RUN wheel=$(echo /wheels/*.whl) \
    && pip install --no-cache-dir "${wheel}[frame,mujoco,parquet,ui]" \
    && rm -rf /wheels
# The system libraries that Drake and its renderer open by name; the package knows which are missing.
# hadolint ignore=DL3008,SC2046
RUN apt-get update \
    && apt-get install -y --no-install-recommends $(python -m burg_drake.system_libraries --packages) \
    && rm -rf /var/lib/apt/lists/* \
    && python -m burg_drake.system_libraries
# Any user may run it; the cache is for this container alone.
ENV BURG_DRAKE_CACHE=/tmp/burg_drake HOME=/tmp
RUN useradd --uid 1000 --no-create-home --home-dir /tmp burg && install -d -o 1000 -g 1000 /work
USER 1000
WORKDIR /work
VOLUME /work
EXPOSE 7100 7300 8080
ENTRYPOINT ["burg-drake"]
CMD ["demo", "-n", "10"]
