# docker build -t outrider .
# docker run --rm --user "$(id -u):$(id -g)" -v "$PWD:/data" -v outrider-kernels:/cache outrider fuse my.bag -o run
FROM python:3.12-slim AS build
WORKDIR /src
COPY pyproject.toml constraints.txt README.md LICENSE ./
COPY src src
RUN python -m venv /opt/outrider && /opt/outrider/bin/pip install --no-cache-dir -c constraints.txt .

FROM python:3.12-slim
COPY --from=build /opt/outrider /opt/outrider
# Anybody may run it, as whoever owns the recordings. Kernels are kept between containers where a volume is at /cache.
RUN useradd --uid 1000 outrider && install -d -m 1777 /cache /data
ENV PATH=/opt/outrider/bin:$PATH OUTRIDER_CACHE=/cache MPLCONFIGDIR=/cache/matplotlib
VOLUME /cache
USER outrider
WORKDIR /data
ENTRYPOINT ["outrider"]
CMD ["--help"]
