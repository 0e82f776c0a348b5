#!/usr/bin/env bash
# Installs the Debian 12 packages that Tessera needs. Idempotent: does nothing when all are there.
#   deploy/install-deps.sh            what the server, the client and the quickstart need
#   deploy/install-deps.sh --tests    and what the tests and benchmarks need
set -euo pipefail

build_packages=(
  g++ cmake ninja-build pkg-config ccache python3
  libgrpc++-dev protobuf-compiler-grpc libprotobuf-dev protobuf-compiler libabsl-dev
  libopenexr-dev libpng-dev libjpeg62-turbo-dev libzip-dev zlib1g-dev libzstd-dev libssl-dev
  libeigen3-dev libtbb-dev libembree-dev libkissfft-dev
  libsqlite3-dev libspdlog-dev libcli11-dev nlohmann-json3-dev
  libosmesa6-dev libglm-dev python3-glad libglfw3-dev libimgui-dev
)
test_packages=(
  libgtest-dev libgmock-dev libboost-graph-dev
  python3-grpcio python3-grpc-tools python3-numpy clang-format git xvfb xauth
)

packages=("${build_packages[@]}")
case "${1:-}" in
  "") ;;
  --tests) packages+=("${test_packages[@]}") ;;
  *)
    echo "usage: deploy/install-deps.sh [--tests]" >&2
    exit 2
    ;;
esac

missing=()
for package in "${packages[@]}"; do
  if ! dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q '^install ok installed$'; then
    missing+=("$package")
  fi
done
if [ "${#missing[@]}" -eq 0 ]; then
  echo "all ${#packages[@]} packages are installed"
  exit 0
fi

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  if ! command -v sudo >/dev/null; then
    echo "missing packages: ${missing[*]}" >&2
    echo "install them as root, or install sudo" >&2
    exit 1
  fi
  as_root=(sudo)
fi
echo "installing ${#missing[@]} packages: ${missing[*]}"
"${as_root[@]}" apt-get update -qq
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
  apt-get install -y -qq --no-install-recommends "${missing[@]}"
