#!/usr/bin/env bash
# qemu.sh FOLDER DISC FORMAT JOB [PARAMETER...]: boots the kernel FOLDER/vmlinuz with FOLDER/initrd and the
# disc (FORMAT raw or qcow2) in an emulated arm64 machine with two of a Raspberry Pi 5's Cortex-A76, in
# software. The guest sees the folder JOB as /job, the kernel the further parameters; the console is
# standard output. Ends when the guest powers off.
#
# A write reaches this machine's disc some time after the guest believes it: only for guests that are thrown away.
set -euo pipefail
folder=$1 disc=$2 format=$3 job=$4
shift 4
exec qemu-system-aarch64 -machine virt -accel tcg,thread=multi -cpu cortex-a76 -smp 2 -m 1G \
  -nodefaults -display none -monitor none -serial stdio -no-reboot \
  -kernel "$folder/vmlinuz" -initrd "$folder/initrd" -append "console=ttyAMA0 quiet $*" \
  -drive "file=$disc,format=$format,if=virtio,cache=unsafe" \
  -virtfs "local,path=$job,mount_tag=job,security_model=none"
