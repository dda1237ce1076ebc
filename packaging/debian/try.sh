#!/usr/bin/env bash
# Installs a .deb in a bare Debian, and uses it: try.sh PACKAGE.deb SCENE.glb [RELEASE]. As root; the folder goes afterwards.
set -euo pipefail
package=$1 scene=$2 release=${3:-bookworm}
. "$(dirname "$0")/../bare-debian.sh"
# `man` and its reader; man pages are left out of small systems otherwise.
bare_debian "$release" man-db,groff-base,nats-server,ca-certificates
cp "$package" "$system/tmp/bottega.deb"
cp "$scene" "$system/tmp/scene.glb"
inside dpkg -i /tmp/bottega.deb
inside bottega --version
inside bottega render /tmp/scene.glb --size 64x64 --spp 4 -o /tmp/picture.png
test -s "$system/tmp/picture.png"
inside sh -c 'man bottega-render | head -12'
inside sh -c 'man bottega | grep -c bottega-jobs'
inside bash -c '. /usr/share/bash-completion/completions/bottega && complete -p bottega'
inside sh -c 'zcat /usr/share/doc/bottega/THIRD-PARTY-LICENCES.txt.gz | wc -l'
# A farm by the nats-server of the distribution.
inside sh -c 'bottega up --listen 127.0.0.1:4299 --no-web --hidden --store-size 1 >/tmp/up.log 2>&1 & up=$!
  for i in $(seq 100); do grep -q "bottega join" /tmp/up.log && break; sleep 0.1; done
  bottega render /tmp/scene.glb --size 64x64 --spp 4 -o /tmp/farm.png --farm || { code=$?; cat /tmp/up.log; }; kill -INT $up; wait $up; exit ${code:-0}'
inside bottega diff /tmp/picture.png /tmp/farm.png --fail-above 0
inside dpkg -r bottega
if inside sh -c 'command -v bottega'; then echo "it is still there"; exit 1; fi
echo "the package works in a bare Debian $release"
