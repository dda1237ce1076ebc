#!/usr/bin/env bash
# Builds the image on a base that mmdebstrap makes, where no registry of images can be reached, and paints by it: try.sh FOLDER SCENE.
# FOLDER holds the .deb. As root; needs buildah and mmdebstrap.
set -euo pipefail
folder=$(realpath "$1") scene=$(realpath "$2")
here=$(cd "$(dirname "$0")" && pwd)
place=$(mktemp -d)
export STORAGE_DRIVER=vfs BUILDAH_ISOLATION=chroot
storage=(--root "$place/storage" --runroot "$place/run")
trap 'rm -rf "$place"' EXIT
mmdebstrap --quiet --variant=minbase --include=ca-certificates bookworm "$place/base.tar"
base=$(buildah "${storage[@]}" from scratch)
buildah "${storage[@]}" add "$base" "$place/base.tar" / >/dev/null
# Where this machine reaches its package registry by a certificate of its own.
[ ! -f /etc/ssl/certs/ca-certificates.crt ] || buildah "${storage[@]}" copy "$base" /etc/ssl/certs/ca-certificates.crt /etc/ssl/certs/ca-certificates.crt >/dev/null
buildah "${storage[@]}" commit --rm "$base" localhost/base >/dev/null
rm "$place/base.tar"
mkdir "$place/context"
cp "$folder"/bottega_*_amd64.deb "$place/context"
proxies=()
for name in http_proxy https_proxy HTTP_PROXY HTTPS_PROXY; do [ -z "${!name:-}" ] || proxies+=(--build-arg "$name=${!name}"); done
buildah "${storage[@]}" build --build-arg BASE=localhost/base "${proxies[@]}" -f "$here/Containerfile" -t bottega:try "$place/context"
name=$(buildah "${storage[@]}" from localhost/bottega:try)
mkdir -m 1777 "$place/pictures"
cp "$scene" "$place/pictures/scene.glb"
run() { buildah "${storage[@]}" run --user 65532:65532 --volume "$place/pictures:/pictures" "$name" -- "$@"; }
run bottega --version
run env XDG_STATE_HOME=/tmp bottega render /pictures/scene.glb --size 64x64 --spp 4 -o /pictures/picture.png
test -s "$place/pictures/picture.png"
buildah "${storage[@]}" images localhost/bottega:try
echo "the image paints"
