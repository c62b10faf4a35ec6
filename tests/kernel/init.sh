#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
#
# The first process of the kernel that run-in-uml boots: mounts, modules, interfaces, the command,
# power off. $job is a folder of the host; what comes back to run-in-uml goes there.
set -eu
export PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin

# Whatever happens, the kernel ends: without a status, if it did not get that far.
# shellcheck disable=SC2317 # called by the trap
power_off() {
	sync
	echo o >/proc/sysrq-trigger
	# The kernel does it in its own time, and must not lose this process before.
	while :; do
		sleep 1
	done
}
trap power_off EXIT

# hostfs takes the host's folder as its options, as it stands. That is not "name" or "name=value", which is
# all that mount(8) of Debian 13 hands over in its new way.
export LIBMOUNT_FORCE_MOUNT2=always

mount -t proc proc /proc
mount -t sysfs sys /sys
# The kernel has mounted its own /dev already, if it is made like Debian's.
grep -q '^devtmpfs /dev ' /proc/mounts || mount -t devtmpfs dev /dev
mkdir -p /dev/pts /dev/shm
mount -t devpts -o ptmxmode=666 devpts /dev/pts
mount -t tmpfs shm /dev/shm
[ -e /dev/fd ] || ln -s /proc/self/fd /dev/fd
mount -t tmpfs tmp /tmp
mount -t tmpfs run /run

# The root cannot be written. What can, is mounted over it from the host once more; so is the source
# tree, which may be in a folder that was just hidden.
mkdir /tmp/job
# shellcheck disable=SC2154 # from the kernel's command line
mount -t hostfs -o "$job" job /tmp/job
source_tree=$(cat /tmp/job/root)
if [ ! -d "$source_tree/tests/kernel" ]; then
	mkdir -p "$source_tree"
	mount -t hostfs -o "ro,$source_tree" source "$source_tree"
fi
while read -r folder; do
	[ -n "$folder" ] || continue
	[ -d "$folder" ] || mkdir -p "$folder"
	mount -t hostfs -o "$folder" writable "$folder"
done </tmp/job/writable
# What a command has written reaches the host soon, even if the kernel is killed later.
echo 100 >/proc/sys/vm/dirty_writeback_centisecs
echo 100 >/proc/sys/vm/dirty_expire_centisecs

# modprobe wants lists that hostfs cannot take new ones of: the order is that of their needs.
modules=/usr/lib/uml/modules/$(uname -r)/kernel
for module in net/can/can net/can/can-raw drivers/net/can/dev/can-dev drivers/net/can/slcan/slcan \
	net/sched/sch_tbf drivers/net/veth; do
	insmod "$modules/$module.ko"
done
# Like hardware, echo a frame to its sender once it has left the interface's queue.
insmod "$modules/drivers/net/can/vcan.ko" echo=1
ip link set lo up
ip link add vcan0 type vcan
ip link set vcan0 up

status=0
export DRIVEBRIDGE_UML=1
timeout -k 10 "$(cat /tmp/job/limit)" bash /tmp/job/command >/tmp/job/output 2>&1 </dev/null ||
	status=$?
sync
echo $status >/tmp/job/status
