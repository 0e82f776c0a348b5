#!/usr/bin/env bash
# Installs what is missing, builds with warnings as errors, checks the formatting and runs every test.
#   deploy/test.sh [CTEST ARGUMENT..]       for example: deploy/test.sh -L unit
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

deploy/install-deps.sh --tests
cmake --preset ci
cmake --build --preset ci
cmake --build --preset ci --target check_format
ctest --preset ci --parallel "$(nproc)" "$@"
