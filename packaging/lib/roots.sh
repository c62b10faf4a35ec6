# SPDX-License-Identifier: Apache-2.0
# shellcheck shell=bash
#
# Roots of Debian releases, one for each release and architecture to build for, and one to check in:
# unpacked once with debootstrap, and kept up to date. What is built is bound to /build.

MOUNTED=()

# Unmounts what a build has mounted.
leave_roots() {
	local i

	for ((i = ${#MOUNTED[@]} - 1; i >= 0; i--)); do
		as_root umount "${MOUNTED[i]}" || as_root umount -l "${MOUNTED[i]}"
	done
	MOUNTED=()
}

# in_chroot ROOT COMMAND...
in_chroot() {
	local root=$1

	shift
	as_root env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root TZ=UTC LC_ALL=C.UTF-8 \
		DEBIAN_FRONTEND=noninteractive chroot "$root" "$@"
}

# What the root's tools need of the machine.
enter_root() {
	local root=$1

	as_root mount -t proc proc "$root/proc"
	MOUNTED+=("$root/proc")
	as_root mount -t devpts -o newinstance,ptmxmode=666,mode=620 devpts "$root/dev/pts"
	MOUNTED+=("$root/dev/pts")
	as_root mount -t tmpfs shm "$root/dev/shm"
	MOUNTED+=("$root/dev/shm")
	[ -L "$root/dev/ptmx" ] || as_root ln -sf pts/ptmx "$root/dev/ptmx"
	as_root cp /etc/resolv.conf /etc/hosts "$root/etc/"
}

# Where Debian's packages come from: what DRIVEBRIDGE_MIRROR says, or this machine's own apt.
debian_mirror() {
	local mirror=${DRIVEBRIDGE_MIRROR:-}

	# shellcheck disable=SC2016 # apt's own variable
	[ -n "$mirror" ] || mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' |
		grep -m 1 '/debian/*$') || die "apt knows no Debian mirror; set DRIVEBRIDGE_MIRROR"
	printf '%s\n' "${mirror%/}"
}

write_sources() {
	local dist=$1 mirror

	mirror=$(debian_mirror)
	printf 'deb %s %s main\n' "$mirror" "$dist" "$mirror" "$dist-updates" \
		"${mirror%/}-security" "$dist-security"
}

# What a root for ARCH has beside the build dependencies.
extra_packages() {
	case $1 in
	"$(dpkg --print-architecture)") echo build-essential fakeroot ;;
	*) echo "crossbuild-essential-$1" "libc6-dev:$1" fakeroot qemu-user ;;
	esac
}

# new_root DIST NAME: the smallest root of the release, if it is not there.
new_root() {
	local dist=$1 root=$ROOTS/$2

	[ ! -e "$root/.complete" ] || return 0
	need_packages debootstrap
	say "making the root $root"
	as_root rm -rf "$root"
	mkdir -p "$ROOTS"
	as_root debootstrap --variant=minbase "$dist" "$root" \
		"$(debian_mirror)" >"$ROOTS/$2.log"
	write_sources "$dist" | as_root tee "$root/etc/apt/sources.list" >/dev/null
	as_root touch "$root/.complete"
}

# update_root NAME PACKAGE...: brings it up to date, and has these packages in it. It is entered.
update_root() {
	local root=$ROOTS/$1

	shift
	in_chroot "$root" apt-get -q update
	in_chroot "$root" apt-get -q -y --no-install-recommends dist-upgrade
	in_chroot "$root" apt-get -q -y --no-install-recommends install "$@"
}

# root_for DIST ARCH: the root to build in.
root_for() {
	local dist=$1 arch=$2 root=$ROOTS/$1-$2 packages

	new_root "$dist" "$dist-$arch"
	enter_root "$root"
	[ "$arch" = "$(dpkg --print-architecture)" ] ||
		in_chroot "$root" dpkg --add-architecture "$arch"
	read -ra packages <<<"$(extra_packages "$arch")"
	update_root "$dist-$arch" "${packages[@]}"
	leave_roots
}

# in_root DIST ARCH FOLDER SOURCE: builds FOLDER/SOURCE in its root.
in_root() {
	local dist=$1 arch=$2 folder=$3 source=$4 root=$ROOTS/$1-$2

	enter_root "$root"
	as_root mkdir -p "$root/build"
	as_root mount --bind "$folder" "$root/build"
	MOUNTED+=("$root/build")
	in_chroot "$root" apt-get -q -y --no-install-recommends -a "$arch" -P "$(profiles "$dist")" \
		build-dep "/build/$source"
	# Tests open ptys and listen on loopback; nothing of the build needs root.
	in_chroot "$root" sh -c "id builder >/dev/null 2>&1 || useradd --create-home builder
		chown -R builder: /build"
	in_chroot "$root" setpriv --reuid=builder --regid=builder --init-groups env HOME=/home/builder \
		DEB_BUILD_OPTIONS="${DEB_BUILD_OPTIONS:-parallel=$(nproc)}" \
		DEB_BUILD_PROFILES="$(profiles "$dist")" \
		sh -c "cd '/build/$source' && dpkg-buildpackage -us -uc --host-arch '$arch'"
	leave_roots
	as_root chown -R "$(id -u):$(id -g)" "$folder"
}
