# SPDX-License-Identifier: Apache-2.0
# shellcheck shell=bash
#
# Debian packages that a script needs: says what is missing, installs exactly that, and leaves the
# network alone when nothing is.

say() {
	printf '== %s\n' "$*"
}

die() {
	printf '%s: %s\n' "${0##*/}" "$*" >&2
	exit 1
}

as_root() {
	if [ "$(id -u)" -eq 0 ]; then
		"$@"
	elif command -v sudo >/dev/null; then
		sudo "$@"
	else
		die "cannot run '$*': be root, or install sudo"
	fi
}

# Runs a command whose output matters only when it fails.
in_silence() {
	local output status=0

	output=$("$@" 2>&1 </dev/null) || status=$?
	[ $status -eq 0 ] || printf '%s\n' "$output" >&2
	return $status
}

# need_packages PACKAGE...
need_packages() {
	local package missing=()

	command -v dpkg-query >/dev/null || die "this script installs Debian packages; on another system
install the counterparts of these and leave out this step: $*"
	for package; do
		# A package that is known but removed answers with success as well: look at its state.
		case $(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null || true) in
		installed) ;;
		*) missing+=("$package") ;;
		esac
	done
	[ ${#missing[@]} -gt 0 ] || return 0
	say "installing Debian packages: ${missing[*]}"
	# One index that cannot be had, of another source than Debian, need not matter.
	in_silence as_root env DEBIAN_FRONTEND=noninteractive apt-get -q update ||
		say "not every package index could be fetched; going on with what there is"
	in_silence as_root env DEBIAN_FRONTEND=noninteractive apt-get -q install -y \
		--no-install-recommends "${missing[@]}"
}

# shellcheck disable=SC2034 # for the scripts that read this file
BUILD_PACKAGES=(gcc libc6-dev cmake ninja-build pkg-config libjansson-dev libmodbus-dev
	esbuild gettext libgnutls28-dev libmicrohttpd-dev libmosquitto-dev libcrypt-dev libpam0g-dev libprotobuf-c-dev protobuf-c-compiler libserialport-dev libsystemd-dev nettle-dev zlib1g-dev zopfli)
# shellcheck disable=SC2034
PAGE_PACKAGES=(python3-venv ca-certificates) # of src/tools/web/page/fetch
# Debian has them since 13.
# shellcheck disable=SC2034
OPEN62541_PACKAGES=(libopen62541-1.4-dev libopen62541-1.4-tools)
