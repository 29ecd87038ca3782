# A farm worker on NVIDIA GPUs, one process a GPU. From the top of the clone:
#   docker build -f packaging/docker/cuda.Dockerfile -t tacdata-worker-cuda .
#   docker run --rm --gpus all -e TACDATA_FARM_TOKEN tacdata-worker-cuda http://HOST:8765
# The host needs a driver for CUDA 13 (580 or newer) and the NVIDIA container toolkit. torch and Warp bring CUDA's libraries.
FROM python:3.12-slim
ENV NVIDIA_VISIBLE_DEVICES=all NVIDIA_DRIVER_CAPABILITIES=compute,utility
RUN apt-get update \
    && apt-get install --yes --no-install-recommends git libgl1 libgomp1 libxrender1 \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /src
COPY . .
RUN pip install --no-cache-dir --constraint .dev/constraints.txt '.[fem,farm]' && rm -rf /src/*
RUN useradd --create-home worker
USER worker
WORKDIR /home/worker
ENTRYPOINT ["tacdata", "farm", "worker", "--device", "cuda"]
