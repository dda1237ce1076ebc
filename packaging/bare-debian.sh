# A bare Debian in a folder that goes with the script: sourced by the trials of packages, as root.
#
#   bare_debian RELEASE PACKAGES    makes it; sets $system to its folder
#   inside COMMAND …                runs a command in it; says which
#
# `PATH_FIRST` may name a folder of its programs that is searched first.

bare_debian() {
  command -v mmdebstrap >/dev/null || apt-get install -y --no-install-recommends mmdebstrap
  local place
  place=$(mktemp -d)
  system=$place/system
  trap "umount '$system/proc' 2>/dev/null || true; rm -rf '$place'" EXIT
  mmdebstrap --quiet --variant=minbase --include="$2" "$1" "$place/system.tar"
  mkdir "$system"
  tar --extract --exclude='./dev/*' --file "$place/system.tar" --directory "$system"
  rm "$place/system.tar"
  mkdir -p "$system/proc" "$system/dev"
  mount -t proc proc "$system/proc"
  mknod -m 666 "$system/dev/null" c 1 3
  mknod -m 666 "$system/dev/random" c 1 8
  mknod -m 666 "$system/dev/urandom" c 1 9
}

inside() {
  echo "+ $*"
  chroot "$system" /usr/bin/env -i PATH="${PATH_FIRST:+$PATH_FIRST:}/usr/sbin:/usr/bin:/sbin:/bin" HOME=/root LANG=C.UTF-8 "$@"
}
