#!/usr/bin/env bash
# The tiny study on a SLURM of one node, made here from Debian's packages, against the same study without SLURM: tables byte by byte.
#
#   sudo scripts/slurm_one_node.sh [CONFIGFILE [TARGET...]]        (default: config/tiny.yaml, the whole study; twice some minutes)
#
# For a machine that is thrown away (a container): it installs packages, writes /etc/slurm and starts daemons as root. It refuses where
# a SLURM is configured already. SNAKEMAKE: the snakemake to take, by default that of .venv.
set -euo pipefail
cd "$(dirname "$0")/.."
config=${1:-config/tiny.yaml}; shift || true
snakemake=${SNAKEMAKE:-$PWD/.venv/bin/snakemake}
python=$(dirname "$snakemake")/python
[ "$(id -u)" = 0 ] || { echo "This installs packages and starts daemons: run it as root, in a container."; exit 1; }
if [ -e /etc/slurm/slurm.conf ] && ! grep -q "^# softtact:" /etc/slurm/slurm.conf; then
    echo "/etc/slurm/slurm.conf is there and not of this script; run it on a machine without SLURM."; exit 1
fi

if ! command -v slurmctld > /dev/null || ! command -v munged > /dev/null; then
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends slurm-wlm munge > /dev/null
fi
"$python" -m pip install --quiet -c constraints.txt snakemake-executor-plugin-slurm

# One node without control groups, which containers do not hand on: processes are followed by their process group.
cores=$(nproc --all)
mkdir -p /etc/slurm /var/spool/slurmctld /var/spool/slurmd /var/log/slurm /run/munge
chown munge: /run/munge
cat > /etc/slurm/slurm.conf << END
# softtact: one node, for scripts/slurm_one_node.sh
ClusterName=one
SlurmctldHost=$(hostname)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
ProctrackType=proctrack/pgid
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerType=sched/builtin
MpiDefault=none
ReturnToService=2
StateSaveLocation=/var/spool/slurmctld
SlurmdSpoolDir=/var/spool/slurmd
SlurmctldLogFile=/var/log/slurm/slurmctld.log
SlurmdLogFile=/var/log/slurm/slurmd.log
SlurmctldPidFile=/run/slurmctld.pid
SlurmdPidFile=/run/slurmd.pid
MinJobAge=86400
# Jobs ask for the memory of a full study; it is not shared out (CR_Core), so the node may claim more than it has.
SlurmdParameters=config_overrides
NodeName=$(hostname) CPUs=$cores RealMemory=64000 State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
END
echo "CgroupAutomount=no" > /etc/slurm/cgroup.conf

stop() { for file in /run/slurmd.pid /run/slurmctld.pid /run/munge/munged.pid; do [ -s "$file" ] && kill "$(cat "$file")" 2> /dev/null; done; true; }
trap stop EXIT
[ -e /etc/munge/munge.key ] || mungekey --create --keyfile /etc/munge/munge.key
chown munge: /etc/munge/munge.key
pgrep -x munged > /dev/null || su -s /bin/sh munge -c "munged --force"
slurmctld -c
slurmd -c
for _ in $(seq 60); do sinfo -h -o %t 2> /dev/null | grep -q idle && break; sleep 1; done
sinfo -h -o %t | grep -q idle || { sinfo -N -l; tail -n 20 /var/log/slurm/*.log; exit 1; }
echo "SLURM $(slurmd -V | cut -d' ' -f2) is up: $(sinfo -h -o '%D node, %c cores, %t')"

work=$(mktemp -d)
for where in local slurm; do
    mkdir "$work/$where"
    cp -r Snakefile config src workflow profiles "$work/$where"
done
export PYTHONPATH=   # each copy of the project runs its own sources
run() { (cd "$work/$1" && PYTHONPATH="$work/$1/src" "$snakemake" "${@:2}" --configfile "$config" > "$work/$1.log" 2>&1) \
    || { tail -n 40 "$work/$1.log"; exit 1; }; }
run slurm --profile workflow/profiles/slurm "$@"
submitted=$(squeue -h --all -t all -o %i | wc -l)
echo "SLURM ran $submitted jobs."
[ "$submitted" -gt 0 ]
run local --cores all "$@"
"$python" scripts/compare_results.py "$work/local/results" "$work/slurm/results"
echo "Both studies lie in $work."
