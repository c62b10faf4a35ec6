# SPDX-License-Identifier: Apache-2.0
# shellcheck shell=bash
#
# Who publishes, as packaging/publisher.example explains.

# What a package says when nobody has said it.
NOBODY='drivebridge maintainers <maintainers@drivebridge.example>'

# read_publisher: sets PUBLISHER_...
read_publisher() {
	local file=${DRIVEBRIDGE_PUBLISHER:-packaging/publisher}

	PUBLISHER_MAINTAINER=$NOBODY
	PUBLISHER_HOMEPAGE=''
	PUBLISHER_SECURITY_CONTACT=''
	PUBLISHER_SUPPORTED_UNTIL=''
	# shellcheck disable=SC2034 # for packaging/repository
	PUBLISHER_REPOSITORY=''
	if [ -e "$file" ]; then
		# shellcheck source=/dev/null
		. "$(readlink -f "$file")"
	elif [ -n "${DRIVEBRIDGE_PUBLISHER:-}" ]; then
		die "no file $file, which DRIVEBRIDGE_PUBLISHER names"
	fi
	grep -Eqx '[^<>@&|/]+ <[^<>@ &|/]+@[^<>@ &|/]+>' <<<"$PUBLISHER_MAINTAINER" ||
		die "PUBLISHER_MAINTAINER is no 'Name <address>': $PUBLISHER_MAINTAINER"
	[ -z "$PUBLISHER_HOMEPAGE" ] || grep -Eqx 'https?://[^ |&]+' <<<"$PUBLISHER_HOMEPAGE" ||
		die "PUBLISHER_HOMEPAGE is no address of a page: $PUBLISHER_HOMEPAGE"
	[ -z "$PUBLISHER_SUPPORTED_UNTIL" ] ||
		[ "$(date -d "$PUBLISHER_SUPPORTED_UNTIL" +%F 2>/dev/null)" = "$PUBLISHER_SUPPORTED_UNTIL" ] ||
		die "PUBLISHER_SUPPORTED_UNTIL is no date as 2031-12-31: $PUBLISHER_SUPPORTED_UNTIL"
}

# need_publisher: ends unless it is known who publishes.
need_publisher() {
	local name missing=()

	[ "$PUBLISHER_MAINTAINER" != "$NOBODY" ] || missing+=(PUBLISHER_MAINTAINER)
	for name in PUBLISHER_SECURITY_CONTACT PUBLISHER_SUPPORTED_UNTIL; do
		[ -n "${!name}" ] || missing+=("$name")
	done
	[ ${#missing[@]} -eq 0 ] || die "not said yet in packaging/publisher: ${missing[*]}; see packaging/publisher.example"
}

# write_publisher: the text that packages have in /usr/share/doc/drivebridge/publisher.
write_publisher() {
	cat <<TEXT
Who publishes these packages: $PUBLISHER_MAINTAINER
Page: ${PUBLISHER_HOMEPAGE:-not said}
Security problems are reported to: ${PUBLISHER_SECURITY_CONTACT:-not said}
Security updates until: ${PUBLISHER_SUPPORTED_UNTIL:-not said}
TEXT
}
