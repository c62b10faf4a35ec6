# SPDX-License-Identifier: Apache-2.0
# shellcheck shell=sh
#
# Simulated drives and Modbus requests, from the installed packages alone.

MAP=/usr/share/doc/drivebridge/register-map.csv
COMMANDS=/usr/share/doc/drivebridge/commands.csv
# shellcheck disable=SC2034 # for the tests
EXAMPLES=/usr/share/doc/drivebridge-sim/examples

# The 0-based address of a register of a drive.
address() {
	awk -F, -v name="$1" '$1 == "drive" && $2 == "holding" && $5 == name {
		print $3; found = 1; exit } END { exit !found }' "$MAP"
}

code() {
	awk -F, -v name="$1" '$2 == name { print $1; found = 1; exit } END { exit !found }' "$COMMANDS"
}

# until_true SECONDS WHAT COMMAND...
until_true() {
	end=$(($(date +%s) + $1))
	what=$2
	shift 2
	until "$@" >/dev/null 2>&1; do
		if [ "$(date +%s)" -gt "$end" ]; then
			echo "not within the time: $what"
			return 1
		fi
		sleep 0.1
	done
}

# read_i32 PORT UNIT REGISTER
read_i32() {
	mbpoll -q -0 -1 -p "$1" -a "$2" -t 4:int -B -r "$(address "$3")" 127.0.0.1 |
		sed -n 's/^\[[0-9]*\]:[[:space:]]*//p'
}

read_u16() {
	mbpoll -q -0 -1 -p "$1" -a "$2" -r "$(address "$3")" 127.0.0.1 |
		sed -n 's/^\[[0-9]*\]:[[:space:]]*//p'
}

# command_drive PORT UNIT NAME [ARGUMENT WORDS...]: done, or accepted and confirmed later (05), as on a machine
# that is busy; what it did is looked at afterwards.
command_drive() {
	port=$1 unit=$2 name=$3
	shift 3
	said=$(mbpoll -q -0 -1 -p "$port" -a "$unit" -r "$(address command_id)" 127.0.0.1 0 \
		"$(code "$name")" "$@" 2>&1) && return 0
	case $said in
	*Acknowledge*) ;;
	*)
		echo "$name: $said"
		return 1
		;;
	esac
}

is_at() {
	[ "$(read_i32 "$1" "$2" position)" = "$3" ]
}

# With its parameters: until then a motion is refused where max-velocity is given, because its speed is not known.
is_online() {
	[ $(($(read_i32 "$1" "$2" status) & 4096)) -ne 0 ]
}

# move_and_check PORT UNIT: enable, go to 70000, be there, disable.
move_and_check() {
	until_true 15 "drive $2 online" is_online "$1" "$2"
	command_drive "$1" "$2" enable
	command_drive "$1" "$2" move_absolute 1 4464 # 65536 + 4464
	until_true 30 "drive $2 at 70000" is_at "$1" "$2" 70000
	echo "drive $2 is at $(read_i32 "$1" "$2" position)"
	command_drive "$1" "$2" disable
}

# runs_nothing_else UNIT...: from where these services are, a shell cannot be executed; their own programs can.
runs_nothing_else() {
	for unit; do
		pid=$(systemctl show --property MainPID --value "$unit")
		nsenter --mount --target "$pid" "$(readlink "/proc/$pid/exe")" --help >/dev/null
		# That of the initramfs lies among the libraries.
		for shell in /bin/sh /usr/lib/klibc/bin/sh; do
			if [ -e "$shell" ] && nsenter --mount --target "$pid" "$shell" -c true; then
				echo "$unit could execute $shell"
				return 1
			fi
		done
	done
}
