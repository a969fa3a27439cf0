#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
#SBATCH --job-name=anlos-batch
#SBATCH --output=%x-%A_%a.log
#SBATCH --open-mode=append
#SBATCH --requeue
# One task of `anlos batch` for each task of a Slurm array.
set -euo pipefail

usage() {
    cat <<'TEXT'
sbatch --array=1-N [sbatch's options] launch/batch/slurm.sh MANIFEST OUT [options]

Runs `anlos batch MANIFEST --out OUT --shard I/N` as task I of N, with as many bags side by
side as --cpus-per-task says, and `anlos batch`'s other options.  MANIFEST and OUT have to be
on a file system that all nodes have.  A task that was killed, or whose node went, goes on
where it was: Slurm requeues it, or the same sbatch once more does it all.

  ANLOS    the program, default anlos in the PATH of the nodes
  TMPDIR   a folder on a disk of the node for what is not done yet, default /tmp
TEXT
}

wrong() {
    printf 'slurm.sh: %s; see --help\n' "$*" >&2
    exit 2
}

case ${1:-} in
-h | --help)
    usage
    exit 0
    ;;
esac
[ $# -ge 2 ] || wrong "expected a manifest and a folder for the results"
[ -n "${SLURM_ARRAY_TASK_ID:-}" ] || wrong "this is a task of sbatch --array=1-N"
# A part of an array does not know how many shards there are.
[ "$SLURM_ARRAY_TASK_MIN" = 1 ] && [ "$SLURM_ARRAY_TASK_MAX" = "$SLURM_ARRAY_TASK_COUNT" ] ||
    wrong "expected all of --array=1-N; what is done already takes no time"
# In the place of the shell: Slurm's signals come to it.
exec "${ANLOS:-anlos}" batch "$1" --out "$2" \
    --shard "$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT" \
    -j "${SLURM_CPUS_PER_TASK:-1}" --scratch "${TMPDIR:-/tmp}" "${@:3}"
