#!/usr/bin/env bash
# Runs the job on a cluster of two nodes that are both this machine: try.sh BOTTEGA SCENE. As root, in a throw-away machine: it writes /etc/slurm and starts
# munged, slurmctld and slurmd, which end with it. Needs slurm-wlm, munge and a nats-server.
set -euo pipefail
program=$(realpath "$1") scene=$(realpath "$2")
here=$(cd "$(dirname "$0")" && pwd)
place=$(mktemp -d)
chmod 755 "$place"
host=$(hostname -s)
mkdir -p /etc/slurm /run/munge "$place"/{ctld,log,bin}
ln -s "$program" "$place/bin/bottega"
[ -s /etc/munge/munge.key ] || { dd if=/dev/urandom of=/etc/munge/munge.key bs=1 count=1024 status=none; }
chown munge: /etc/munge/munge.key /run/munge; chmod 400 /etc/munge/munge.key
cat >/etc/slurm/slurm.conf <<END
ClusterName=try
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
AuthType=auth/munge
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
ReturnToService=2
StateSaveLocation=$place/ctld
SlurmdSpoolDir=$place/%n
SlurmctldPidFile=$place/ctld.pid
SlurmdPidFile=$place/%n.pid
SlurmctldLogFile=$place/log/ctld
SlurmdLogFile=$place/log/%n
SelectType=select/cons_tres
NodeName=n1 NodeHostname=$host NodeAddr=127.0.0.1 Port=17001 CPUs=$(nproc) State=UNKNOWN
NodeName=n2 NodeHostname=$host NodeAddr=127.0.0.1 Port=17002 CPUs=$(nproc) State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
END
started=()
show() { cat "$place"/bottega-*.log "$place"/log/n1 2>/dev/null | tail -60; }
trap 'show; kill "${started[@]}" 2>/dev/null || true; wait || true; rm -rf "$place"' EXIT
runuser -u munge -- munged --foreground --force & started+=($!)
sleep 1
slurmctld -D & started+=($!)
for node in n1 n2; do mkdir "$place/$node"; slurmd -D -N "$node" & started+=($!); done
for _ in $(seq 60); do sinfo -h -o %T 2>/dev/null | grep -q idle && ! sinfo -h -o %T | grep -qv idle && break; sleep 0.5; done
sinfo
cd "$place"
export PATH=$place/bin:$PATH
job=$(sbatch --parsable --wait --nodes=2 "$here/bottega.sbatch" "$scene" "$place/picture.exr" --size 160x120 --spp 64) || true

test -s picture.exr
bottega request show picture.exr >/dev/null
grep "auction:" "bottega-$job.log"
echo "Slurm job $job painted $(stat -c %s picture.exr) bytes"
