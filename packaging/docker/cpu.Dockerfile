# A farm worker on processor cores. From the top of the clone:
#   docker build -f packaging/docker/cpu.Dockerfile -t tacdata-worker-cpu .
#   docker run --rm -e TACDATA_FARM_TOKEN tacdata-worker-cpu http://HOST:8765
# PyPI's torch brings CUDA along (4 GB). --build-arg PIP_EXTRA_INDEX_URL=... with PyTorch's CPU index saves that.
FROM python:3.12-slim
ARG PIP_EXTRA_INDEX_URL=""
# git: the version of the wheel. The libraries: VTK, which the mesher imports, and OpenMP.
RUN apt-get update \
    && apt-get install --yes --no-install-recommends git libgl1 libgomp1 libxrender1 \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /src
COPY . .
RUN pip install --no-cache-dir --constraint .dev/constraints.txt '.[fem,farm]' && rm -rf /src/*
RUN useradd --create-home worker
USER worker
WORKDIR /home/worker
ENTRYPOINT ["tacdata", "farm", "worker", "--device", "cpu"]
