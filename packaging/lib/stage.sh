# SPDX-License-Identifier: Apache-2.0
# shellcheck shell=bash
#
# The source tree as a Debian source package; lib/publisher.sh has said whose.

# Of the sources: the last commit, or now for a tree without git.
source_time() {
	git log -1 --format=%ct 2>/dev/null || date +%s
}

# Grows with every commit: apt takes a package for the same as the one that is there, and keeps that, when
# the versions are equal. A commit with a tag of the version, v0.1.0, is that version.
version_of_sources() {
	local version

	version=$(awk '/#define DB_VERSION_(MAJOR|MINOR|PATCH) / { version = version sep $3; sep = "." }
		END { print version }' include/drivebridge/version.h)
	if [ "$(git tag --points-at HEAD 2>/dev/null | grep -Fx "v$version")" ]; then
		printf '%s\n' "$version"
	elif git rev-parse HEAD >/dev/null 2>&1; then
		printf '%s~git%s.%s\n' "$version" "$(git rev-list --count HEAD)" \
			"$(git rev-parse --short=8 HEAD)"
	else
		printf '%s~git0.%s\n' "$version" "$(source_time)"
	fi
}

# The files that belong to the sources, each ended by a null byte.
source_files() {
	if git rev-parse --is-inside-work-tree >/dev/null 2>&1; then
		git ls-files -z --cached --others --exclude-standard | while IFS= read -r -d '' file; do
			# A file that is deleted but not committed is still listed.
			[ ! -e "$file" ] || printf '%s\0' "$file"
		done
	else
		find . -path ./build -prune -o -type f -printf '%P\0'
	fi
}

# revision DIST: newer releases of Debian have the greater one, so that an upgrade takes theirs.
revision() {
	case $1 in
	bookworm) echo "1~deb12u1" ;;
	trixie) echo "1~deb13u1" ;;
	*) echo 1 ;;
	esac
}

# What the release's lintian knows of Debian's policy.
standards() {
	case $1 in
	trixie) echo 4.7.2 ;;
	*) echo 4.6.2 ;;
	esac
}

# Build profiles for what the release does not have: Debian has open62541 since 13.
profiles() {
	local dist=$1

	[ "$dist" != host ] || dist=$(sed -n 's/^VERSION_CODENAME=//p' /etc/os-release)
	[ "$dist" != bookworm ] || echo pkg.drivebridge.noopcua
}

# write_changelog DIST VERSION
write_changelog() {
	local dist=$1

	[ "$dist" != host ] || dist=UNRELEASED
	cat <<TEXT
drivebridge ($2-$(revision "$1")) $dist; urgency=medium

  * Version $2.
    What changed is in /usr/share/doc/drivebridge/changelog.gz.

 -- $PUBLISHER_MAINTAINER  $(date -u -R -d "@$SOURCE_DATE_EPOCH")
TEXT
}

# stage DIST FOLDER: FOLDER gets the unpacked source package and the .orig.tar.xz beside it; sets
# STAGED to the name of the unpacked one.
stage() {
	local dist=$1 folder=$2 version

	SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(source_time)}
	export SOURCE_DATE_EPOCH
	version=$(version_of_sources)
	STAGED=drivebridge-$version
	mkdir -p "$folder/$STAGED"
	source_files | tar -c --null -T - | tar -x -C "$folder/$STAGED"
	# Where packages are built there is no network.
	src/tools/web/page/fetch
	tar -c build/page/node_modules/uplot | tar -x -C "$folder/$STAGED"
	chmod -R u=rwX,go=rX "$folder/$STAGED"
	# Packages keep these times.
	find "$folder/$STAGED" -exec touch -h -d "@$SOURCE_DATE_EPOCH" {} +
	tar -c -C "$folder" --sort=name --mtime="@$SOURCE_DATE_EPOCH" --owner=0 --group=0 \
		--numeric-owner --format=gnu "$STAGED" |
		xz -6 -T1 >"$folder/drivebridge_$version.orig.tar.xz"
	cp -R "$folder/$STAGED/packaging/debian" "$folder/$STAGED/debian"
	sed -i -e "s|@STANDARDS@|$(standards "$dist")|" -e "s|@MAINTAINER@|$PUBLISHER_MAINTAINER|" \
		-e "s|@HOMEPAGE@|$PUBLISHER_HOMEPAGE|" -e '/^Homepage: $/d' "$folder/$STAGED/debian/control"
	write_publisher >"$folder/$STAGED/debian/publisher"
	write_changelog "$dist" "$version" >"$folder/$STAGED/debian/changelog"
}
