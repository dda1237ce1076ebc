#!/usr/bin/env bash
# Installs the wheel in a bare Debian that has nothing but Python, paints a picture, and one with a farm of two: try.sh WHEEL.whl SCENE.glb
# [RELEASE]. As root; needs the package registry and nothing else. The folder goes afterwards.
set -euo pipefail
wheel=$1 scene=$2 release=${3:-bookworm}
. "$(dirname "$0")/../bare-debian.sh"
PATH_FIRST=/root/venv/bin
bare_debian "$release" python3-venv,ca-certificates
# The way to the registry is this machine's.
for file in /etc/resolv.conf /etc/hosts /etc/ssl/certs/ca-certificates.crt /etc/pip.conf; do
  if [ -f "$file" ]; then cp "$file" "$system$file"; fi
done
cp "$wheel" "$system/tmp/"
cp "$scene" "$system/tmp/scene.glb"
name=/tmp/$(basename "$wheel")
inside python3 -m venv /root/venv
# Two commands to a picture.
begun=$SECONDS
inside pip install --quiet "$name"
inside python3 -c 'import bottega; bottega.render("/tmp/scene.glb", spp=4, size=(320, 240)).save("/tmp/python.png")'
echo "pip install and the first picture: $((SECONDS - begun)) s"
inside bottega render /tmp/scene.glb --size 320x240 --spp 4 -o /tmp/program.png
inside bottega diff /tmp/python.png /tmp/program.png --fail-above 0
# Two more to a farm of two: the server comes with the wheel.
inside sh -c 'bottega up --listen 127.0.0.1:4298 --no-web --hidden --store-size 1 >/tmp/up.log 2>&1 & up=$!
  for i in $(seq 100); do grep -q "bottega join" /tmp/up.log && break; sleep 0.1; done
  bottega join >/tmp/join.log 2>&1 & join=$!
  for i in $(seq 100); do grep -q "waiting for work" /tmp/join.log && break; sleep 0.1; done
  bottega render /tmp/scene.glb --size 320x240 --spp 4 -o /tmp/farm.png --farm || { code=$?; cat /tmp/up.log /tmp/join.log; }
  kill -INT $join $up; wait $join $up; exit ${code:-0}'
inside bottega diff /tmp/program.png /tmp/farm.png --fail-above 0
echo "the wheel works in a bare Debian $release"
