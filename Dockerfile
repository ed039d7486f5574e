# docker build -t outrider . && docker run --rm -v "$PWD:/data" -v outrider-kernels:/cache outrider fuse /data/my.bag -o /data/run
FROM python:3.12-slim
WORKDIR /src
COPY pyproject.toml constraints.txt README.md LICENSE ./
COPY src src
RUN pip install --no-cache-dir -c constraints.txt . && rm -rf /src/*
# Compiled kernels are kept between containers where a volume is mounted here.
ENV OUTRIDER_CACHE=/cache
VOLUME /cache
WORKDIR /data
ENTRYPOINT ["outrider"]
CMD ["--help"]
