#!/bin/sh
# All recordings of a folder on a Slurm cluster, 8 parts of them, each part on a node with 4 cores.
#   sbatch batch_slurm.sh /shared/walks /shared/results
# A part that a node lost is queued again and goes on where it was. When all have ended, the table is written by
#   odom batch /shared/walks --out /shared/results
#SBATCH --job-name=odom-batch
#SBATCH --array=0-7
#SBATCH --cpus-per-task=4
#SBATCH --mem=4G
#SBATCH --requeue
set -eu
exec odom batch "$1" --out "$2" --jobs 2 --shard "$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT"
