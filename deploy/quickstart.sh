#!/usr/bin/env bash
# Installs, builds and runs Tessera's main job in the caller's folder: two materials are compressed and made into tile
# sets on a server of its own, two meshes are dressed once, and every mesh is shown in both materials under two lights.
set -euo pipefail

usage() {
  cat <<'EOF'
usage: deploy/quickstart.sh [--keep] [DIR|FILE]

  DIR|FILE   a BTF of yours (UBO2003 folder or zip, manifest, multi-part EXR); it takes the place of the first
             generated material
  --keep     leave the server running and its data in place

Writes eight pictures and contact-sheet.png into the current folder.
EOF
}

keep=0
source=""
for argument in "$@"; do
  case "$argument" in
    --keep) keep=1 ;;
    -h | --help)
      usage
      exit 0
      ;;
    -*)
      usage >&2
      exit 2
      ;;
    *)
      if [ -n "$source" ]; then
        usage >&2
        exit 2
      fi
      source=$(realpath -- "$argument")
      ;;
  esac
done
if [ -n "$source" ] && [ ! -e "$source" ]; then
  echo "no such file or folder: $source" >&2
  exit 2
fi

output=$PWD
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
started=$SECONDS

cd "$root"
deploy/install-deps.sh
if [ ! -f build/release/CMakeCache.txt ]; then
  cmake --preset release -DTESSERA_BUILD_TESTS=OFF
fi
cmake --build --preset release --target tessera tessera-server tessera-viewer
built=$SECONDS
cd "$output"
PATH="$root/build/release/bin:$PATH"

# Milliseconds since the epoch.
now_ms() { echo $((${EPOCHREALTIME/./} / 1000)); }

# Prints a command, runs it and says how long it took.
run() {
  printf '\n$'
  printf ' %q' "$@"
  printf '\n'
  local begin status=0
  begin=$(now_ms)
  "$@" || status=$?
  printf '  [%d.%03d s]\n' $((($(now_ms) - begin) / 1000)) $((($(now_ms) - begin) % 1000))
  return "$status"
}

data=$(mktemp -d "$output/tessera-data.XXXXXX")
server_pid=""
stop_server() {
  if [ -n "$server_pid" ]; then
    kill "$server_pid" 2>/dev/null || true
    wait "$server_pid" 2>/dev/null || true
  fi
  rm -rf "$data"
}
trap stop_server EXIT

printf '\n$ tessera-server --data %q --listen 127.0.0.1:0 &\n' "$data"
tessera-server --data "$data" --listen 127.0.0.1:0 >"$data/server.out" 2>"$data/server.log" &
server_pid=$!
for _ in $(seq 100); do
  TESSERA_SERVER=$(sed -n 's/^listening on //p' "$data/server.out")
  [ -n "$TESSERA_SERVER" ] && break
  if ! kill -0 "$server_pid" 2>/dev/null; then
    cat "$data/server.log" >&2
    exit 1
  fi
  sleep 0.1
done
if [ -z "$TESSERA_SERVER" ]; then
  echo "the server did not start within 10 s; its log:" >&2
  cat "$data/server.log" >&2
  exit 1
fi
export TESSERA_SERVER
echo "  listening on $TESSERA_SERVER"

codec=(--codec dsh-cls --kl 25 --kv 25)
if [ -n "$source" ]; then
  first=user-btf
  run tessera material import "$source" --name "$first" "${codec[@]}"
else
  first=reactdiffuse
  run tessera material generate reactdiffuse --name "$first" --size 128 --lights ubo81 --views ubo81 "${codec[@]}"
fi
second=wrinkles
run tessera material generate wrinkles --name "$second" --size 128 --lights ubo81 --views ubo81 "${codec[@]}"
run tessera material list

synthesize=(tessera tileset synthesize --arrangement surface-96 --tile 64 --strip 16)
if ! run "${synthesize[@]}" "$first"; then
  [ -n "$source" ] || exit 1
  echo "trying again by force: expect the material to change direction where tiles are turned"
  run "${synthesize[@]}" "$first" --force
fi
run "${synthesize[@]}" "$second"
run tessera tileset list

for mesh in torus genus3; do
  run tessera mesh dress "builtin:$mesh" --arrangement surface-96 -o "$mesh.tsra"
  # The first material is bound, then exchanged for the second: a look-up, timed by the command.
  for material in "$first" "$second"; do
    run tessera mesh redress "$mesh.tsra" --tileset "surface-96/$material"
  done
done

pictures=()
for mesh in torus genus3; do
  for material in "$first" "$second"; do
    # Polar angle from the viewer and azimuth, in degrees: from the upper left, then grazing from the upper right.
    for light in 35,120 60,55; do
      picture="$mesh-$material-light-${light%,*}.png"
      run tessera preview "surface-96/$material" --dressing "$mesh.tsra" --light "$light" --size 640x480 -o "$picture"
      pictures+=("$picture")
    done
  done
done
run tessera sheet "${pictures[@]}" --columns 4 -o contact-sheet.png

printf '\nset-up and build: %d s, main job: %d s\n' $((built - started)) $((SECONDS - built))
printf 'look at %s\n' "$output/contact-sheet.png"
if [ "$keep" -eq 1 ]; then
  trap - EXIT
  printf 'the server goes on at %s (process %d, data in %s)\n' "$TESSERA_SERVER" "$server_pid" "$data"
fi
