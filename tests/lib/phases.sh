# SPDX-License-Identifier: Apache-2.0
# shellcheck shell=bash
#
# The phases of tests/run and what they share. A step that fails is counted and the rest still runs.

VENV=build/venv

# The library of OPC UA, which Debian 12 does not have: CMakePresets.json knows the folder.
need_open62541() {
	if [ "$(sed -n 's/^VERSION_CODENAME=//p' /etc/os-release)" != bookworm ]; then
		need_packages "${OPEN62541_PACKAGES[@]}"
	elif [ ! -d build/debian13 ]; then
		say "unpacking Debian 13's open62541 in build/debian13"
		in_silence tests/lib/unpack-open62541 build/debian13
	fi
}

# The tools that come from Python packages, as tests/requirements.txt pins them.
need_venv() {
	local stamp=$VENV/installed.txt

	if cmp -s tests/requirements.txt "$stamp" && "$VENV/bin/python" -c 'import pytest' 2>/dev/null
	then
		return 0
	fi
	say "installing Python packages into $VENV: $(tr '\n' ' ' <tests/requirements.in)"
	rm -rf "$VENV"
	/usr/bin/python3 -m venv "$VENV"
	"$VENV/bin/pip" --quiet --disable-pip-version-check install --require-hashes -r tests/requirements.txt
	cp tests/requirements.txt "$stamp"
}

# What the page in the browser is made with.
need_page() {
	[ -e build/page/fetched ] || say "fetching what the page is made with into build/page"
	src/tools/web/page/fetch
}

# count PASSED FAILED
count() {
	PASSED=$((PASSED + $1))
	FAILED=$((FAILED + $2))
}

# Runs a command with its output in a log, shown only when it fails. Counts nothing.
quietly() {
	local log=build/logs/$PHASE-$1.log

	shift
	if "$@" >"$log" 2>&1 </dev/null; then
		return 0
	fi
	printf -- '--- failed: %s (%s)\n' "$*" "$log"
	tail -n 60 "$log"
	return 1
}

# step LABEL COMMAND...: one check.
step() {
	local label=$1

	if quietly "$@"; then
		count 1 0
	else
		FAILURES+=("$PHASE: $label")
		count 0 1
	fi
}

# The rest of the calling shell and what it starts get only the time that nothing else wants.
yield_to_others() {
	chrt --idle --pid 0 $BASHPID 2>/dev/null || renice -n 19 -p $BASHPID >/dev/null || true
}

# configure_and_build PRESET [TARGET]. A preset links 200 programs, most of them tests: mold takes a tenth of ld's time.
# Phases that run side by side and need the same build wait for each other.
configure_and_build() {
	(
		flock 9
		cmake --preset "$1" -DCMAKE_EXE_LINKER_FLAGS=-fuse-ld=mold &&
			cmake --build --preset "$1" --target "${2:-all}" -- -k 0 -j "$JOBS"
	) 9>"build/logs/$1.lock"
}

# need_build PRESET [TARGET]: a build that the phase needs. Only its failure counts.
need_build() {
	if quietly "build-$1" configure_and_build "$@"; then
		return 0
	fi
	FAILURES+=("$PHASE: the build of preset $1")
	count 0 1
	return 1
}

# run_ctest PRESET [COMMAND-PREFIX...]: counts the test cases inside the programs.
run_ctest() {
	local preset=$1 folder=build/$1 names

	shift
	rm -f "$folder/Testing/Temporary/LastTest.log"
	"$@" ctest --preset "$preset" -j "$JOBS" --no-tests=error \
		>"build/logs/$PHASE-ctest.log" 2>&1 || true
	# Programs first, then their totals; see the tool for how crashes are counted.
	names=$(tests/tools/count-cmocka "$folder/Testing/Temporary/LastTest.log") || true
	if [ -z "$names" ]; then
		tail -n 60 "build/logs/$PHASE-ctest.log"
		names='0 1 (ctest did not run)'
	fi
	# shellcheck disable=SC2086 # two numbers and a list of programs
	set -- $names
	count "$1" "$2"
	if [ "$2" -gt 0 ]; then
		shift 2
		FAILURES+=("$PHASE: $*")
		grep -E -B 12 'FAILED|ERROR|Sanitizer|runtime error' "build/logs/$PHASE-ctest.log" |
			head -n 150 || true
	fi
}

# The modules of the page that need no browser.
run_node_tests() {
	local log=build/logs/$PHASE-node.log passed failed

	build/page/venv/bin/node --test --test-reporter=tap tests/unit/tools/page/*.mjs >"$log" 2>&1 || true
	passed=$(sed -n 's/^# pass //p' "$log")
	failed=$(sed -n 's/^# fail //p' "$log")
	if [ "${passed:-0}" -eq 0 ] || [ "$failed" -ne 0 ]; then
		tail -n 60 "$log"
		FAILURES+=("$PHASE: node")
	fi
	count "${passed:-0}" "${failed:-1}"
}

# It is loaded over whatever line a gateway has: all of it, compressed. Another language adds its own file.
check_page_size() {
	local size

	size=$(find build/asan/web -name "*.gz" ! -name "*.mo.gz" -exec cat {} + | wc -c) || return 1
	printf '%d bytes\n' "$size"
	[ "$size" -lt 150000 ]
}

phase_unit() {
	need_build asan || return 0
	export ASAN_OPTIONS=detect_leaks=1:detect_stack_use_after_return=1:strict_string_checks=1
	export UBSAN_OPTIONS=print_stacktrace=1
	run_ctest asan
	run_node_tests
	step "size of the page" check_page_size
}

# Both compilers, every warning an error; clang's about src are told by clang-tidy (style).
phase_compilers() {
	step gcc configure_and_build gcc
	step clang tests/tools/clang-warnings
}

phase_threads() {
	local prefix=()

	need_build tsan threaded || return 0
	# Thread sanitizer needs its memory where old kernels had it; not every container allows this.
	if setarch "$(uname -m)" -R true 2>/dev/null; then
		prefix=(setarch "$(uname -m)" -R)
	fi
	export TSAN_OPTIONS=second_deadlock_stack=1
	run_ctest tsan "${prefix[@]}"
	# Commands and reads are where the threads meet, and reloads hand drives from one to the other.
	run_pytest tsan "${prefix[@]}" -- tests/e2e/test_exactly_once.py tests/e2e/test_reload.py
}

c_files() {
	find include src docs tests -name '*.[ch]'
}

check_format() {
	c_files | grep -q . && c_files | xargs "$VENV/bin/clang-format" --dry-run -Werror
}

# It does not see jansson's loops, which are macros, and is told what they mean, without a semicolon, where its
# options end. nullPointerOutOfMemory, since 2.16, does not see that several allocations are judged together.
check_cppcheck() {
	cppcheck --std=c11 --enable=warning,performance,portability --inline-suppr \
		--suppress=missingIncludeSystem --suppress=normalCheckLevelMaxBranches \
		--suppress=nullPointerOutOfMemory \
		--error-exitcode=1 --quiet -j "$JOBS" -D_GNU_SOURCE \
		'-Djson_array_foreach(a,i,v)=while((i=0,(v=json_array_get(a,i))))' \
		'-Djson_object_foreach(o,k,v)=while((k="",(v=json_object_get(o,k))))' \
		-I include -I src/common -I src/bridge -I src/tools -I src -I docs/generate src docs/generate
}

# How far its analyzer follows a function: five times as far takes five times as long, and is for the day of a
# release (ANALYZER_NODES=225000).
check_clang_tidy() {
	cmake --preset clang >/dev/null &&
		cmake --build build/clang --target drivebridge_sparkplug >/dev/null &&
		find src docs -name '*.c' -print0 |
		xargs -0 -P "$JOBS" -n 8 timeout 600 clang-tidy -p build/clang --quiet \
			--extra-arg=-Xclang --extra-arg=-analyzer-config \
			--extra-arg=-Xclang --extra-arg=max-nodes="$ANALYZER_NODES"
}

# Every script of the project: those that say so in their first line, and what they read.
check_shell() {
	local scripts

	mapfile -t scripts < <({
		grep -rlE '^#!/bin/(ba)?sh' demo src docs/generate tests packaging .ci
		grep -rl '^# shellcheck shell=' tests packaging
	} | sort -u)
	[ ${#scripts[@]} -gt 10 ] || die "only ${#scripts[@]} scripts found"
	shellcheck -S warning -x "${scripts[@]}"
}

# What the sources must not contain, and what each must.
check_text() {
	local bad=0 status=0

	grep -rnIwE 'TO''DO|FIX''ME|X''XX' src include docs/generate tests demo || status=$?
	# 1: nothing found; 2: it did not look.
	[ $status -eq 1 ] || bad=1
	if c_files | xargs grep -L 'SPDX-License-Identifier: Apache-2.0' | grep .; then
		printf 'no SPDX line in these\n'
		bad=1
	fi
	return $bad
}

# Types of the page's modules, as far as they follow from the code and its comments; names that nothing uses.
check_page_types() {
	need_page &&
		build/page/venv/bin/node build/page/node_modules/typescript/bin/tsc -p src/tools/web/page/tsconfig.json
}

# Mistakes in the page's modules that types do not show, and functions that are too long.
check_page_lint() {
	need_page &&
		build/page/venv/bin/node build/page/node_modules/eslint/bin/eslint.js -c tests/lib/eslint.config.mjs src/tools/web/page
}

phase_style() {
	step format check_format
	step text check_text
	step rooms tests/tools/rooms
	step form tests/tools/form
	step spelling tests/tools/spelling
	step texts tests/tools/texts
	step locked tests/tools/lock-requirements --check
	step "types of the page" check_page_types
	step "lint of the page" check_page_lint
	step shellcheck check_shell
	step cppcheck check_cppcheck
	step clang-tidy check_clang_tidy
	step analyzer tests/analyze
}

# The generated documents are what the table says today.
phase_docs() {
	local file

	need_build asan || return 0
	rm -rf build/docs
	mkdir -p build/docs
	build/asan/regmap-export csv >build/docs/register-map.csv || true
	build/asan/regmap-export md >build/docs/register-map.md || true
	build/asan/regmap-export commands >build/docs/commands.csv || true
	build/asan/regmap-export st docs/generate/registers/drivebridge.st.in \
		>build/docs/drivebridge.st || true
	build/asan/config-export >build/docs/config-keys.csv || true
	build/asan/mqtt-export >build/docs/mqtt-keys.csv || true
	build/asan/web-export >build/docs/web-keys.csv || true
	build/asan/opcua-export >build/docs/opcua-keys.csv || true
	build/asan/tls-export >build/docs/tls-keys.csv || true
	build/asan/regmap-export events >build/docs/events.csv || true
	for file in nodes:opcua-nodes.csv table:type_rows.c nodeset:drivebridge.NodeSet2.xml; do
		"$VENV/bin/python" docs/generate/opcua-types "${file%%:*}" build/docs/register-map.csv \
			build/docs/commands.csv build/docs/events.csv build/asan/opcua-export \
			>"build/docs/${file#*:}" || true
	done
	step type_rows.c diff -u src/tools/opcua/type_rows.c build/docs/type_rows.c
	build/asan/ctl-export csv >build/docs/drivebridgectl.csv || true
	for file in register-map.csv register-map.md commands.csv drivebridge.st config-keys.csv \
		mqtt-keys.csv web-keys.csv opcua-keys.csv tls-keys.csv opcua-nodes.csv events.csv \
		drivebridge.NodeSet2.xml drivebridgectl.csv; do
		step "$file" diff -u "docs/$file" "build/docs/$file"
	done
	build/asan/ctl-export bash >build/docs/drivebridgectl || true
	build/asan/ctl-export zsh >build/docs/_drivebridgectl || true
	for file in drivebridgectl _drivebridgectl; do
		step "completion $file" diff -u "packaging/completions/$file" "build/docs/$file"
	done
	for file in strict prefixed; do
		"$VENV/bin/python" docs/generate/st-variants "$file" build/docs/drivebridge.st \
			>"build/docs/drivebridge-$file.st" || true
		step "$file" diff -u "docs/drivebridge-$file.st" "build/docs/drivebridge-$file.st"
	done
	cp -r docs/clients build/docs/clients
	"$VENV/bin/python" docs/generate/client-files build/asan build/docs/clients || true
	step clients diff -ru docs/clients build/docs/clients
	"$VENV/bin/python" docs/generate/temperaments-table >build/docs/temperaments.md || true
	step temperaments.md diff -u docs/temperaments.md build/docs/temperaments.md
	[ "$FAILED" -eq 0 ] ||
		printf '%s\n' 'to bring docs/ up to date: cmake --build --preset asan --target docs-generate' \
			"and $VENV/bin/python docs/generate/temperaments-table >docs/temperaments.md"
}

# What a fuzzer finds by chance does not belong into a run that must say the same to everybody: the seeds do,
# among them every input that has ever broken something.
phase_fuzz() {
	local folder=build/asan/fuzz name

	if [ "$FUZZ_SECONDS" -gt 0 ]; then
		folder=build/fuzz/fuzz
		need_build fuzz fuzzers || return 0
	else
		need_build asan || return 0
	fi
	export ASAN_OPTIONS=allow_addr2line=1 UBSAN_OPTIONS=print_stacktrace=1
	for name in tests/fuzz/fuzz_*.c; do
		name=$(basename "$name" .c)
		step "$name" fuzz_one "$folder/$name" "${name#fuzz_}"
	done
}

# fuzz_one TARGET NAME: its seeds, which every target has, and for FUZZ_SECONDS what libFuzzer makes of them.
fuzz_one() {
	local found=build/fuzz/found/$2

	if [ "$FUZZ_SECONDS" -eq 0 ]; then
		timeout 120 "$1" "tests/fuzz/corpus/$2"
	else
		# What it finds goes to build/, the seeds stay as they are.
		mkdir -p "$found"
		"$1" -max_total_time="$FUZZ_SECONDS" -timeout=30 -rss_limit_mb=1024 -artifact_prefix="$found-" "$found" \
			"tests/fuzz/corpus/$2"
	fi
}

# What is counted is instructions, with valgrind, and bytes, not times, so that a machine that is busy or slow
# is no reason to fail. What else needs the optimized build is here, too.
phase_bench() {
	need_build gcc || return 0
	step instructions tests/bench/instructions build/gcc
	step memory build/gcc/bench/bench_drive_memory
	step memcheck tests/memcheck build/gcc
	step powercut "$VENV/bin/python" tests/powercut --moments 60 --commands 240 --late 10
}

# start_pytest NAME PRESET [COMMAND-PREFIX...] -- FILE-OR-FOLDER...: runs it; its report and log have this name.
start_pytest() {
	local name=$1 preset=$2 prefix=()

	shift 2
	while [ "$1" != -- ]; do
		prefix+=("$1")
		shift
	done
	shift
	rm -f "build/logs/$name".{xml,collected,failed}
	DRIVEBRIDGE_BUILD=$PWD/build/$preset DRIVEBRIDGE_COLLECTED=$PWD/build/logs/$name.collected \
		DRIVEBRIDGE_FAILED=$PWD/build/logs/$name.failed \
		"${prefix[@]}" "$VENV/bin/python" -m pytest -q \
		-n "${PYTEST_WORKERS:-$((JOBS * 4))}" --junitxml="build/logs/$name.xml" "$@" \
		>"build/logs/$name.log" 2>&1 </dev/null || true
}

# count_pytest NAME [ALONE]: what start_pytest saw, and what it saw of those that failed and ran ALONE.
count_pytest() {
	local log=build/logs/$1.log numbers reports=("build/logs/$1.xml" "build/logs/$1.collected")

	# Tests that failed while the machine stood still are run again: tests/e2e/stalls.py.
	grep '^repeated: ' "$log" || true
	if [ $# -gt 1 ]; then
		log=build/logs/$2.log
		reports+=("build/logs/$2.xml")
		grep '^repeated: ' "$log" || true
	fi
	numbers=$("$VENV/bin/python" tests/tools/count-junit "${reports[@]}") || numbers='0 1'
	# shellcheck disable=SC2086 # two numbers and names
	set -- $numbers
	count "$1" "$2"
	if [ "$2" -gt 0 ]; then
		shift 2
		tail -n 150 "$log"
		FAILURES+=("$PHASE: pytest ($log): $*")
	fi
}

# How many failed tests are run alone. Where more fail, it is not because they ran side by side.
ALONE_MAX=40

# count_with_alone NAME COMMAND...: counts what start_pytest saw. The tests that failed run once more, alone, as arguments
# of COMMAND, whose report is NAME-alone (tests/e2e/stalls.py).
count_with_alone() {
	local name=$1 failed=()

	shift
	[ ! -s "build/logs/$name.failed" ] || mapfile -t failed <"build/logs/$name.failed"
	if [ ${#failed[@]} -eq 0 ] || [ ${#failed[@]} -gt $ALONE_MAX ]; then
		count_pytest "$name"
		return
	fi
	printf 'run once more, alone: %s\n' "${failed[@]}"
	"$@" "${failed[@]}"
	count_pytest "$name" "$name-alone"
}

start_alone() {
	PYTEST_WORKERS=0 start_pytest "$@"
}

# run_pytest PRESET [COMMAND-PREFIX...] -- FILE-OR-FOLDER...
run_pytest() {
	local name=$PHASE-pytest front=()

	start_pytest "$name" "$@"
	while [ "$1" != -- ]; do
		front+=("$1")
		shift
	done
	count_with_alone "$name" start_alone "$name-alone" "${front[@]}" --
}

phase_e2e() {
	need_build asan || return 0
	export ASAN_OPTIONS=detect_leaks=1 UBSAN_OPTIONS=print_stacktrace=1
	# Compiles the tests once, which takes 5 s of a processor, so that not each worker does it for itself. Errors are
	# shown by the run below.
	quietly collect "$VENV/bin/python" -m pytest -q --collect-only tests/e2e >/dev/null || true
	run_pytest asan -- tests/e2e
}

# On a real CAN stack: inside kernels of their own, with what they write going to build/logs. Address
# sanitizer does not run there (a process has 512 GB of addresses), so this is the optimized build.
# Such a kernel has one processor, so there are two of them side by side.
phase_kernel() {
	local rest

	need_build gcc || return 0
	mapfile -t rest < <(find tests/kernel -name 'test_*.py' ! -name test_vsmd_can.py | sort)
	in_kernel vsmd_can tests/kernel/test_vsmd_can.py &
	in_kernel rest "${rest[@]}"
	wait $!
	count_with_alone kernel-vsmd_can in_kernel vsmd_can-alone
	count_with_alone kernel-rest in_kernel rest-alone
}

# in_kernel NAME FILE...
in_kernel() {
	local name=kernel-$1

	shift
	start_alone "$name" gcc tests/kernel/run-in-uml -t 1200 -w build/logs \
		-l "build/logs/$name-messages.log" -- "$@"
}

# Every half minute, how far the phase is: the end of the log that was written last.
show_progress() {
	local started=$SECONDS newest line nap=

	trap 'kill "$nap" 2>/dev/null; exit' TERM
	while kill -0 $$ 2>/dev/null; do
		sleep "${PROGRESS_SECONDS:-30}" &
		nap=$!
		wait "$nap" || true
		newest=$(find build/logs -maxdepth 1 -name "$PHASE-*.log" -printf '%T@ %p\n' | sort -n | tail -n 1 | cut -d ' ' -f 2)
		line=$(tail -c 400 "${newest:-/dev/null}" | tr -cd '[:print:]\n' | grep . | tail -n 1 | cut -c 1-70) || true
		printf '   %d s  %s\n' $((SECONDS - started)) "$line"
	done
}

# Sets SPENT: what the programs that this shell started and that have ended took of the processors, s.
note_spent() {
	local stat

	# In ticks, of which Linux shows a hundred in a second.
	read -r -a stat <"/proc/$BASHPID/stat"
	SPENT=$(((stat[15] + stat[16]) / 100))
}

# run_phase NAME: its result is kept for finish().
run_phase() {
	local started=$SECONDS progress before

	PHASE=$1
	PASSED=0
	FAILED=0
	FAILURES=()
	say "$PHASE"
	note_spent
	before=$SPENT
	show_progress &
	progress=$!
	"phase_$PHASE"
	kill "$progress"
	wait "$progress" 2>/dev/null || true
	note_spent
	printf '%s: %d passed, %d failed (%d s, %d s of a processor)\n' "$PHASE" $PASSED $FAILED \
		$((SECONDS - started)) $((SPENT - before))
	printf '%s\n' "$PASSED $FAILED" "${FAILURES[@]}" >"build/logs/$PHASE.result"
}

# Where each phase is when several run: these compute and do not look at the clock, and get the time that the others
# leave; these watch drives and clients, wait most of the time, and run next to the end-to-end tests, after the build
# that they need.
COMPUTING=(compilers style docs fuzz)
WATCHING=(kernel threads bench)
declare -A BUILD_OF=([kernel]=gcc [threads]="tsan threaded" [bench]=gcc)

# run_computing NAME...
run_computing() {
	local phase

	yield_to_others
	for phase; do
		run_phase "$phase"
	done
}

# build_for PHASE
build_for() {
	PHASE=$1
	yield_to_others
	# shellcheck disable=SC2086 # a preset, and perhaps a target
	quietly build configure_and_build ${BUILD_OF[$1]}
}

# run_watching NAME...
run_watching() {
	local phase

	# The end-to-end tests have their own workers meanwhile.
	PYTEST_WORKERS=${PYTEST_WORKERS:-$JOBS}
	for phase; do
		# What is wrong with the build is the phase's to say.
		(build_for "$phase") >/dev/null || true
		run_phase "$phase"
	done
}

# The process and the name of each row of phases.
declare -A ROWS=()

# start_row NAME PHASE...: runs run_NAME with these phases, in a process group of its own, which ends with this script.
# What it prints is shown by end_rows.
start_row() {
	local name=$1

	shift
	[ $# -gt 0 ] || return 0
	set -m
	PROGRESS_SECONDS=86400 "run_$name" "$@" >"build/logs/$name.log" 2>&1 </dev/null &
	ROWS[$!]=$name
	set +m
}

end_rows() {
	local pid

	for pid in "${!ROWS[@]}"; do
		wait "$pid" || true
		cat "build/logs/${ROWS[$pid]}.log"
	done
	ROWS=()
}

stop_rows() {
	local pid

	for pid in "${!ROWS[@]}"; do
		kill -- "-$pid" 2>/dev/null || true
	done
}

# run_side_by_side PHASE...
run_side_by_side() {
	local phase first=() watching=() computing=()

	for phase; do
		case " ${COMPUTING[*]} : ${WATCHING[*]} " in
		*" $phase "*:*) computing+=("$phase") ;;
		*:*" $phase "*) watching+=("$phase") ;;
		*) first+=("$phase") ;;
		esac
	done
	if [ ${#first[@]} -eq 0 ]; then
		first=("${watching[@]}")
		watching=()
	else
		# The build that most others need: nothing runs next to it. What is wrong with it is the phase's to say.
		say "the build of unit and end-to-end tests"
		PHASE=first
		quietly build configure_and_build asan >/dev/null || true
		note_spent
		printf 'built (%d s, %d s of a processor)\n' $SECONDS "$SPENT"
	fi
	trap stop_rows EXIT
	start_row computing "${computing[@]}"
	start_row watching "${watching[@]}"
	for phase in "${first[@]}"; do
		run_phase "$phase"
	done
	end_rows
	trap - EXIT
}

# finish PHASE...: what all of them saw. A phase without a result has failed.
finish() {
	local phase numbers broken=() sum=0 bad=0 lines

	for phase; do
		lines=("0 1" "$phase: it broke off")
		[ ! -s "build/logs/$phase.result" ] || mapfile -t lines <"build/logs/$phase.result"
		read -r -a numbers <<<"${lines[0]}"
		sum=$((sum + numbers[0]))
		bad=$((bad + numbers[1]))
		broken+=("${lines[@]:1}")
	done
	if [ ${#broken[@]} -gt 0 ]; then
		say "failed"
		printf '%s\n' "${broken[@]}"
	fi
	printf '%d passed, %d failed\n' "$sum" "$bad"
	[ "$bad" -eq 0 ]
}
