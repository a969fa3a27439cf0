#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# launch/batch/slurm.sh on a real Slurm, of one machine with two nodes: a task is killed and
# a node drained, and the same command once more completes the table.
# usage: test_slurm.sh ANLOS
set -euo pipefail
# shellcheck source=tests/launch/check.sh
. "$(dirname "$0")/check.sh"
anlos=$(realpath "$1")
export PATH=$PATH:/usr/sbin

for tool in munged slurmctld slurmd sbatch; do
    if ! command -v $tool >/dev/null; then
        echo "skipped: there is no $tool (Debian: slurm-wlm, munge)"
        exit 77
    fi
done
if [ "$(id -u)" != 0 ]; then
    echo "skipped: slurmd needs root"
    exit 77
fi

# -- bags: two scans, and links to them
chmod 755 "$work" # munged looks at who may come by
cat >"$work/launch.yaml" <<TEXT
nodes: [array, scan, dsp, recon, track, can]
array: {uri: "sim:none.yaml"}
TEXT
for x in 1 5; do
    sed "s/0.13, 0.11, 0.4/0.1$x, 0.11, 0.4/" "$root/tests/nodes/point.yaml" >"$work/$x.yaml"
    "$anlos" sim "$work/$x.yaml" --out "$work/$x" >/dev/null
    "$anlos" bag import "$work/$x/scene" -o "$work/$x.mcap" >/dev/null
done
mkdir "$work/bags"
for i in {1..24}; do
    ln "$work/$((1 + 4 * (i % 2))).mcap" "$work/bags/$i.mcap"
    printf 'bags/%d.mcap\ttag=place%d\n' "$i" $((i % 2))
done >"$work/bags.txt"

# -- Slurm, without systemd and cgroups
started=()
stop_slurm() {
    local pid
    [ ${#started[@]} = 0 ] || kill "${started[@]}" 2>/dev/null || true
    for pid in "${started[@]}"; do # until they are gone: they still write there
        timeout 20 tail --pid="$pid" -f /dev/null 2>/dev/null || true
    done
    rm -rf "$work"
}
trap stop_slurm EXIT

# Ports that nobody has, below those that the kernel gives to who connects.
ports() {
    local port
    for ((port = 20000 + RANDOM % 12000; ; port++)); do
        (exec 3<>"/dev/tcp/127.0.0.1/$port") 2>/dev/null || echo "$port"
    done | head -n 3
}

start_slurm() {
    local host port
    host=$(hostname -s)
    mapfile -t port < <(ports)
    dd if=/dev/urandom of="$work/munge.key" bs=1024 count=1 2>/dev/null
    chmod 600 "$work/munge.key"
    munged --force --foreground --key-file="$work/munge.key" --socket="$work/munge.socket" \
        --pid-file="$work/munge.pid" --seed-file="$work/munge.seed" \
        --log-file="$work/munge.log" >/dev/null 2>&1 &
    started+=($!)
    mkdir "$work/state"
    cat >"$work/slurm.conf" <<TEXT
ClusterName=anlos
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=${port[0]}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$work/munge.socket
CredType=cred/munge
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool-%n
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd-%n.pid
SlurmctldLogFile=$work/slurmctld.log
SlurmdLogFile=$work/slurmd-%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerType=sched/builtin
SchedulerParameters=batch_sched_delay=0,sched_interval=1,sched_min_interval=100000
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
ReturnToService=2
KillWait=2
NodeName=one,two NodeHostname=$host NodeAddr=127.0.0.1 Port=${port[1]},${port[2]} CPUs=1
PartitionName=all Nodes=one,two Default=YES State=UP
TEXT
    export SLURM_CONF=$work/slurm.conf
    come_up test -S "$work/munge.socket"
    slurmctld -D -c >/dev/null 2>&1 &
    started+=($!)
    slurmd -D -N one >/dev/null 2>&1 &
    started+=($!)
    slurmd -D -N two >/dev/null 2>&1 &
    started+=($!)
    come_up nodes_are_idle
}

nodes_are_idle() {
    [ "$(sinfo -h -N -o %T 2>/dev/null | sort | uniq -c | xargs)" = "2 idle" ]
}

# wait_for COMMAND...: until it works; not for ever.  Of daemons that do not start here,
# come_up: nothing can be tested with them.
wait_or() { # CODE WHAT COMMAND...
    local code=$1 what=$2 end=$((SECONDS + 120))
    shift 2
    until "$@"; do
        if ((SECONDS > end)); then
            echo "$what: waited 120 s for: $*"
            tail -n 20 "$work"/*.log
            exit "$code"
        fi
        sleep 0.1
    done
}
wait_for() { wait_or 1 FAILED "$@"; }
come_up() { wait_or 77 "skipped: Slurm does not start here" "$@"; }

# What the tasks run: the first one that is shard 3 dies half way, with what it has begun.
cat >"$work/anlos" <<'TEXT'
#!/usr/bin/env bash
case " $* " in *" --shard 3/8 "*) mkdir KILLED 2>/dev/null || exec ANLOS "$@" ;; *) exec ANLOS "$@" ;; esac
mkdir KILLED/scratch
ANLOS "$@" --scratch KILLED/scratch &
pid=$!
while kill -STOP $pid; do # it cannot end while it is stopped
    for begun in KILLED/scratch/*/*/; do
        [ ! -d "$begun" ] || { kill -KILL $pid && touch KILLED/half-way && wait $pid; }
    done
    kill -CONT $pid
done
wait $pid
TEXT
sed -i "s|ANLOS|$anlos|g; s|KILLED|$work/killed|g" "$work/anlos"
chmod +x "$work/anlos"

nobody_works() {
    [ -z "$(squeue -h 2>/dev/null)" ] && squeue -h >/dev/null 2>&1
}

submit() {
    (cd "$work" && ANLOS=$work/anlos sbatch --array=1-8 "$root/launch/batch/slurm.sh" \
        bags.txt slurm --launch launch.yaml) >/dev/null
}

some_result_is_there() {
    compgen -G "$work/slurm/*.json" >/dev/null
}

results_in() { # what depends on the bags alone
    cat "$work/$1"/*.json | sed 's/,"run":.*//' | sort
}

test_a_killed_task_and_a_drained_node_cost_nothing_but_time() {
    start_slurm
    submit
    wait_for some_result_is_there
    scontrol update nodename=two state=drain reason=test
    wait_for nobody_works
    run ls "$work/killed/half-way"
    expect_code 0
    run "$anlos" batch merge "$work/slurm" --manifest "$work/bags.txt"
    expect_code 1
    expect_text "results of $work/bags.txt are missing"
    submit
    wait_for nobody_works
    run "$anlos" batch merge "$work/slurm" --manifest "$work/bags.txt" --out "$work/table.csv"
    expect_code 0
    run grep -c ',done,' "$work/table.csv"
    [ "$output" = 24 ] || complain "not all of 24 bags are done"
    run cat "$work"/*-batch-*.log
    expect_text "3 bags: 0 done now, 3 before, 0 failed"
    expect_no_text "left"
}

test_every_result_is_that_of_the_bare_loop() {
    run bash -c 'cd "$1" && for i in {1..8}; do "$2" batch bags.txt --out loop --shard $i/8 \
        --launch launch.yaml -j 1 || exit; done' loop "$work" "$anlos"
    expect_code 0
    output=$(diff <(results_in slurm) <(results_in loop) | cut -c 1-200)
    [ -z "$output" ] || complain "they differ"
    [ "$(results_in loop | wc -l)" = 24 ] || complain "not 24 results"
    [ "$(results_in loop | grep -o '"hash":"[0-9a-f]*"' | sort -u | wc -l)" = 2 ] ||
        complain "the frames are not those of two scans"
}

test_a_part_of_an_array_is_refused() {
    run env SLURM_ARRAY_TASK_ID=3 SLURM_ARRAY_TASK_COUNT=1 SLURM_ARRAY_TASK_MIN=3 \
        SLURM_ARRAY_TASK_MAX=3 "$root/launch/batch/slurm.sh" bags.txt out
    expect_code 2
    expect_text "expected all of --array=1-N"
    run "$root/launch/batch/slurm.sh" bags.txt out
    expect_code 2
    expect_text "this is a task of sbatch --array=1-N"
}

run_tests
